"""The Wavefront OBJ format: geometry only, one vertex list, no splitting at texture seams."""

from __future__ import annotations

import re

import numpy as np

from csm._counts import counted
from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh, coordinates, decode
from csm.mesh.shape import Mesh


def parse_obj(data: bytes) -> RawMesh:
    r"""Read the `v` and `f` lines of an OBJ file; faces may have any number of corners.

    A face corner may be `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative numbers count back from the vertices read so far;
    a `\` at a line's end continues it.  Normals, texture coordinates, groups, materials, lines and points are skipped.
    Vertices that no face uses are kept and noted, since a file that was cut between two lines has such.

    Raises
    ------
    MeshError
        If there is no vertex, a line cannot be read, the file ends in the middle of a face, or a face refers to vertex
        0 (OBJ counts from 1) or to one that does not exist.
    """
    vertices: list[list[str]] = []
    corners: list[int] = []
    sizes: list[int] = []
    last: list[str] = []
    for line in re.sub(r"\\(\r\n|\n|\r)", " ", decode(data)).splitlines():
        words = line.partition("#")[0].split()
        if words and words[0] == "v":
            vertices.append(words[1:])
        elif words and words[0] == "f":
            corners += _corners(words[1:], len(sizes), len(vertices))
            sizes.append(len(words) - 1)
        last = words or last
    if not vertices:
        raise MeshError("there is no line 'v x y z', so this is no OBJ mesh")
    edges = _edges(data, sizes)
    if last and last[0] == "f" and len(last) < 4 and not (len(last) == 3 and data.endswith((b"\n", b"\r"))):
        raise MeshError(f"the file ends in the middle of face {len(sizes) - 1} ({' '.join(last)!r}): it was cut short")
    if edges and max(sizes) < 3:
        raise MeshError(f"{edges[0]}; these are edges, and csm works on surfaces: save the mesh with its faces")
    points = coordinates(vertices)
    numbers = np.array(corners, dtype=np.int64)
    _require_existing(numbers, np.array(sizes, dtype=np.int64), len(points))
    return RawMesh(points, numbers, np.array(sizes, dtype=np.int64), (*_notes(numbers, len(points)), *edges))


def _edges(data: bytes, sizes: list[int]) -> tuple[str, ...]:
    """Return a note on faces of fewer than three corners with the line of the first; none if there are none."""
    short = [face for face, size in enumerate(sizes) if size < 3]
    if not short:
        return ()
    lines = [i for i, line in enumerate(decode(data).splitlines(), 1) if line.split()[:1] == ["f"]]
    more = f" (the first of {len(short)} such faces)" if len(short) > 1 else ""
    return (f"line {lines[short[0]]} has a face of {counted(sizes[short[0]], 'corner')}{more}, wanted three or more",)


def _corners(words: list[str], face: int, n_so_far: int) -> list[int]:
    try:
        corners = [int(word.partition("/")[0]) for word in words]
    except ValueError:
        raise MeshError(f"face {face} is 'f {' '.join(words)[:80]}', wanted vertex numbers") from None
    for corner in corners:
        if corner == 0:
            raise MeshError(f"face {face} refers to vertex 0, but OBJ counts vertices from 1")
        if corner < -n_so_far:
            raise MeshError(f"face {face} refers to vertex {corner} (counted back), but only {n_so_far} precede it")
        if corner > 2**62:
            raise MeshError(f"face {face} refers to vertex {corner}, which cannot be")
    return [corner - 1 if corner > 0 else n_so_far + corner for corner in corners]


def _require_existing(corners: np.ndarray, sizes: np.ndarray, n_vertices: int) -> None:
    outside = np.flatnonzero(corners >= n_vertices)
    if outside.size:
        face = int(np.searchsorted(np.cumsum(sizes), outside[0], side="right"))
        raise MeshError(
            f"face {face} refers to vertex {corners[outside[0]] + 1}, but there are {n_vertices} (1..{n_vertices}): "
            "vertices are missing from the file"
        )


def _notes(corners: np.ndarray, n_vertices: int) -> tuple[str, ...]:
    unused = n_vertices - len(np.unique(corners))
    if not unused:
        return ()
    return (f"{unused} of {n_vertices} vertices belong to no face; if that is unexpected, the file was cut short",)


def format_obj(mesh: Mesh) -> bytes:
    """Write `v` and `f` lines; coordinates are written so that they read back exactly."""
    points = ["v " + " ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join([f"# {mesh.n_vertices} vertices, {mesh.n_faces} faces", *points, *faces]) + "\n").encode("ascii")
