"""The PLY format, ASCII and binary of both byte orders; reading is trimesh's, held to the counts of the header."""

from __future__ import annotations

import io
import re

import numpy as np
from numpy.typing import NDArray
from trimesh.exchange.ply import load_ply

from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh
from csm.mesh.shape import Mesh


def parse_ply(data: bytes) -> RawMesh:
    """Read the vertices and triangles of a PLY file; other elements and properties are skipped.

    Raises
    ------
    MeshError
        If the header is damaged, counts differ from the header's (a cut file), or a face is not a triangle.
    """
    n_vertices, n_faces = counts_ply(data)
    # The bare loader makes no Trimesh, so nothing is merged; fix_texture would split vertices at texture seams.
    loaded = load_ply(io.BytesIO(data), fix_texture=False, skip_materials=True)
    vertices = np.asarray(loaded["vertices"])
    faces = np.asarray(loaded["faces"] if n_faces else np.zeros((0, 3), np.int64))
    if len(vertices) != n_vertices:
        raise MeshError(f"the header announces {n_vertices} vertices, but {len(vertices)} could be read: a cut file?")
    if faces.ndim != 2 or faces.shape != (n_faces, 3):
        raise MeshError(
            f"the header announces {n_faces} faces, but they are {len(faces)} triangles: either the file is cut short "
            "or has faces of more than three corners; csm reads triangle meshes only, so triangulate it first"
        )
    return RawMesh.of(vertices, faces)


def counts_ply(data: bytes) -> tuple[int, int]:
    """Return the numbers of vertices and faces that the header announces."""
    head, end, _ = data.partition(b"end_header")
    if not (data.startswith(b"ply") and end):
        raise MeshError("wanted a PLY header from 'ply' to 'end_header'; this is another format or a damaged file")
    counts = {name: int(n) for name, n in re.findall(rb"^element\s+(\w+)\s+(\d+)", head, re.MULTILINE)}
    if b"vertex" not in counts:
        raise MeshError("the PLY header names no element 'vertex'")
    return counts[b"vertex"], counts.get(b"face", 0)


def format_ply(mesh: Mesh, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Write binary little-endian PLY with float64 coordinates and, if given, colours (N, 3) per vertex."""
    fields = [("x", "<f8"), ("y", "<f8"), ("z", "<f8")]
    names = ["property double x", "property double y", "property double z"]
    if colors is not None:
        fields += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
        names += ["property uchar red", "property uchar green", "property uchar blue"]
    points = np.empty(mesh.n_vertices, dtype=fields)
    columns = [*mesh.vertices.T, *(colors.T if colors is not None else ())]
    for (key, _), column in zip(fields, columns, strict=True):
        points[key] = column
    faces = np.empty(mesh.n_faces, dtype=[("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.faces
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {mesh.n_vertices}", *names]
    head += [f"element face {mesh.n_faces}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(head).encode("ascii") + points.tobytes() + faces.tobytes()
