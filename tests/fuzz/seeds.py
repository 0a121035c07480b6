"""Small valid files of every format that csm reads, as material for mutation."""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Iterator

import h5py
import numpy as np
import scipy.io
import trimesh

from csm.mesh.io.obj import format_obj
from csm.mesh.io.off import format_off
from csm.mesh.io.ply import format_ply
from tests.shapes import sphere

MESH = sphere(0)
V, F = MESH.vertices, MESH.faces


def seeds() -> Iterator[tuple[str, bytes]]:
    """Yield suffixes and files; several of a format where it has several kinds."""
    yield ".off", format_off(MESH)
    yield ".off", format_off(MESH, np.full((MESH.n_vertices, 3), 9, np.uint8))
    yield ".off", b"OFF\n" + format_off(MESH)[4:].replace(b" ", b"\n")
    yield ".obj", format_obj(MESH)
    yield ".obj", format_obj(MESH).replace(b"f ", b"f -1/2/3 \\\n ") + b"vt 0 0\nvn 0 0 1\n"
    yield ".ply", format_ply(MESH)
    yield from ((".ply", data) for data in _plys())
    soup = trimesh.Trimesh(V, F, process=False)
    yield ".stl", soup.export(file_type="stl")
    yield ".stl", soup.export(file_type="stl_ascii").encode()
    yield ".glb", soup.export(file_type="glb")
    yield ".gltf", _gltf(soup)
    yield from ((".npz", data) for data in _npzs())
    yield from ((".mat", data) for data in _mats())
    yield from ((".mat", data) for data in _hdf5s())
    yield from ((".vtk", data) for data in _vtks())
    yield ".off.gz", gzip.compress(format_off(MESH))
    yield ".ply.gz", gzip.compress(format_ply(MESH))


def _plys() -> Iterator[bytes]:
    axes = "property float x\nproperty float y\nproperty float z\n"
    head = f"element vertex 12\n{axes}element face 20\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, row)) for row in V.tolist()] + ["3 " + " ".join(map(str, row)) for row in F.tolist()]
    yield ("ply\nformat ascii 1.0\ncomment x\n" + head + "\n".join(rows) + "\n").encode()
    faces = b"".join(bytes([3 + i % 2]) + np.resize(row, 3 + i % 2).astype(">i4").tobytes() for i, row in enumerate(F))
    yield ("ply\nformat binary_big_endian 1.0\n" + head).encode() + V.astype(">f4").tobytes() + faces
    strip = "element vertex 12\n" + axes + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    corners = np.array([9, 0, 1, 3, 2, -1, 4, 5, 7, 8], "<i4").tobytes()
    yield ("ply\nformat binary_little_endian 1.0\n" + strip).encode() + V.astype("<f4").tobytes() + corners


def _gltf(soup: trimesh.Trimesh) -> bytes:
    files = soup.export(file_type="gltf", merge_buffers=True)
    import base64

    document = json.loads(files["model.gltf"])
    for buffer in document["buffers"]:
        buffer["uri"] = "data:;base64," + base64.b64encode(files[buffer["uri"]]).decode()
    return json.dumps(document).encode()


def _npzs() -> Iterator[bytes]:
    for save in (np.savez, np.savez_compressed):
        stream = io.BytesIO()
        save(stream, vertices=V, faces=F)
        yield stream.getvalue()


def _mats() -> Iterator[bytes]:
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = {"VERT": V, "TRIV": F + 1, "name": "a"}, np.eye(2)
    xyz = {"X": V[:, :1], "Y": V[:, 1:2], "Z": V[:, 2:], "TRIV": F + 1, "labels": np.arange(12)}
    for variables, options in (
        ({"shape": xyz}, {}),
        ({"cell": cell}, {}),
        ({"VERT": V, "TRIV": F + 1}, {"do_compression": True}),
        ({"VERT": V, "TRIV": (F + 1).astype(float)}, {"format": "4"}),
    ):
        stream = io.BytesIO()
        scipy.io.savemat(stream, variables, **options)
        yield stream.getvalue()


def _hdf5s() -> Iterator[bytes]:
    for options in ({}, {"chunks": (3, 4), "compression": "gzip"}):
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=512) as file:
            group = file.create_group("shape")
            group.create_dataset("VERT", data=V.T, **options)
            group.create_dataset("TRIV", data=(F + 1).T, **options)
            file.create_dataset("cell", data=np.array([group.ref], dtype=h5py.ref_dtype))
        yield stream.getvalue()


def _vtks() -> Iterator[bytes]:
    table = np.column_stack([np.full(len(F), 3), F])
    for form in ("ASCII", "BINARY"):
        put = (lambda a, t: a.astype(t).tobytes()) if form == "BINARY" else (lambda a, _: _words(a))
        data = f"# vtk DataFile Version 3.0\nx\n{form}\nDATASET POLYDATA\nPOINTS {len(V)} float\n".encode()
        data += put(V, ">f4") + f"\nPOLYGONS {len(F)} {table.size}\n".encode() + put(table, ">i4")
        yield data + b"\nPOINT_DATA 12\n"


def _words(array: np.ndarray) -> bytes:
    return " ".join(map(str, array.ravel().tolist())).encode()
