"""Reading and writing of meshes, point maps and name lists; with the store and the reports, the only code on the disk.

The parsers of the single formats are functions of bytes, so nothing else than `files` opens a file.  All readers keep
the order and the number of the vertices, because ground truth and labels are vertex numbers.
"""

from csm.mesh.io.archives import unpack, unpacked
from csm.mesh.io.files import atomic_path, copy_file, list_files, list_folders, natural_key, read_bytes
from csm.mesh.io.maps import read_labels, read_names, read_pairs, read_vts, write_map
from csm.mesh.io.meshes import READABLE, WRITABLE, count_vertices, read_mesh, read_polygons, write_mesh

__all__ = [
    "READABLE",
    "WRITABLE",
    "atomic_path",
    "copy_file",
    "count_vertices",
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
