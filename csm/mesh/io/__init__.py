"""Reading and writing of meshes, point maps and name lists; with the store and the reports, the only code on the disk.

The parsers of the single formats are functions of bytes, so nothing else than `files` and `archives` opens a file, and
`guard` has the limits on what is opened, unpacked and raised.  All readers keep the order and the number of the
vertices, because ground truth and labels are vertex numbers.

A reader is csm's own where order, sizes and messages have to be controlled: .off, .obj, .ply, .stl, .vtk (legacy),
.npz (its headers are read by NumPy), .mat up to v7, and .glb/.gltf, whose files name sizes of memory and other files
that libraries take on trust.  HDF5 (.mat v7.3) is read by h5py, in a process with limits.  Compressed files and
archives are unpacked by Python's zlib, zipfile and tarfile.
"""

from csm.mesh.io.archives import unpack, unpacked
from csm.mesh.io.files import atomic_path, copy_file, file_digest, list_files, list_folders, natural_key, read_bytes
from csm.mesh.io.maps import read_labels, read_names, read_pairs, read_vts, write_map
from csm.mesh.io.meshes import READABLE, WRITABLE, count_vertices, read_mesh, read_polygons, write_mesh

__all__ = [
    "READABLE",
    "WRITABLE",
    "atomic_path",
    "copy_file",
    "count_vertices",
    "file_digest",
    "list_files",
    "list_folders",
    "natural_key",
    "read_bytes",
    "read_labels",
    "read_mesh",
    "read_names",
    "read_pairs",
    "read_polygons",
    "read_vts",
    "unpack",
    "unpacked",
    "write_map",
    "write_mesh",
]
