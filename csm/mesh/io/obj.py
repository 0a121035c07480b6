"""The Wavefront OBJ format: geometry only, one vertex list, no splitting at texture seams."""

from __future__ import annotations

import numpy as np

from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh, coordinates, decode, polygon_error
from csm.mesh.shape import Mesh


def parse_obj(data: bytes) -> RawMesh:
    """Read the `v` and `f` lines of an OBJ file.

    A face corner may be `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative numbers count back from the vertices read so far.
    Normals, texture coordinates, groups, materials, lines and points are skipped.

    Raises
    ------
    MeshError
        If there is no vertex, a line cannot be read, a face is not a triangle or uses vertex 0 (OBJ counts from 1).
    """
    vertices: list[list[str]] = []
    faces: list[list[int]] = []
    for line in decode(data).replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        words = line.partition("#")[0].split()
        if words and words[0] == "v":
            vertices.append(words[1:])
        elif words and words[0] == "f":
            faces.append(_triangle(words[1:], len(faces), len(vertices)))
    if not vertices:
        raise MeshError("there is no line 'v x y z', so this is no OBJ mesh")
    return RawMesh(coordinates(vertices), np.array(faces, dtype=np.int64).reshape(len(faces), 3))


def _triangle(words: list[str], face: int, n_so_far: int) -> list[int]:
    if len(words) != 3:
        raise polygon_error(face, len(words))
    try:
        corners = [int(word.partition("/")[0]) for word in words]
    except ValueError:
        raise MeshError(f"face {face} is 'f {' '.join(words)}', wanted three vertex numbers") from None
    for corner in corners:
        if corner == 0:
            raise MeshError(f"face {face} refers to vertex 0, but OBJ counts vertices from 1")
        if corner < -n_so_far:
            raise MeshError(f"face {face} refers to vertex {corner} (counted back), but only {n_so_far} precede it")
    return [corner - 1 if corner > 0 else n_so_far + corner for corner in corners]


def format_obj(mesh: Mesh) -> bytes:
    """Write `v` and `f` lines; coordinates are written so that they read back exactly."""
    points = ["v " + " ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join([f"# {mesh.n_vertices} vertices, {mesh.n_faces} faces", *points, *faces]) + "\n").encode("ascii")
