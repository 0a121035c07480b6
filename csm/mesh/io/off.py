"""The OFF format: http://www.geomview.org/docs/html/OFF.html, with the variants that are met in shape data sets."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh, coordinates, decode, polygon_error
from csm.mesh.shape import Mesh

# The optional prefixes (texture, colour, normal) only add columns after x y z.  ModelNet glues the counts to "OFF".
# Case matters: N stands for normals, n for n dimensions.
_KEYWORD = re.compile(r"(?:(?:ST)?C?N?)(?P<dimension>4?n?)OFF|c?off")


def parse_off(data: bytes) -> RawMesh:
    """Read an ASCII OFF, COFF, NOFF, CNOFF or STOFF file.

    Counts may stand on the line of the keyword or on their own, the keyword may be missing, comments and blank lines
    may stand anywhere, and extra columns and lines after the last face are ignored.

    Raises
    ------
    MeshError
        If the file is binary, cut short, not three-dimensional, or has a face that is not a triangle.
    """
    if re.match(rb"\s*\w*OFF\s+BINARY", data[:64]):
        raise MeshError("this is a binary OFF file, which csm does not read; save it as ASCII OFF or as PLY")
    rows = _rows(decode(data))
    n_vertices, n_faces = _take_counts(rows)
    if len(rows) < n_vertices + n_faces:
        raise MeshError(
            f"the header announces {n_vertices} vertices and {n_faces} faces, but only {len(rows)} lines follow: "
            "the file is cut short"
        )
    faces = rows[n_vertices : n_vertices + n_faces]
    return RawMesh(coordinates(rows[:n_vertices]), _triangles(faces))


def count_off(data: bytes) -> int:
    """Return the number of vertices that the head of an OFF file announces."""
    return _take_counts(_rows(decode(data)))[0]


def _rows(text: str) -> list[list[str]]:
    """Return the words of every line that is more than a comment."""
    if "#" in text:
        text = re.sub(r"#[^\r\n]*", "", text)
    return [words for line in text.splitlines() if (words := line.split())]


def _take_counts(rows: list[list[str]]) -> tuple[int, int]:
    """Remove keyword and counts from the front of `rows` and return the numbers of vertices and faces."""
    head = rows.pop(0) if rows else []
    keyword = _KEYWORD.match(head[0]) if head else None
    if keyword:
        if keyword["dimension"]:
            raise MeshError(f"this is a {keyword[0]} file; csm reads meshes in three dimensions only")
        glued = head[0][keyword.end() :]
        head = [glued, *head[1:]] if glued else head[1:]
        head = head or (rows.pop(0) if rows else [])
    if len(head) < 2 or not all(word.isdecimal() for word in head[:2]):
        raise MeshError(f"wanted 'OFF' and the numbers of vertices and faces, found {' '.join(head)[:60]!r}")
    return int(head[0]), int(head[1])


def _triangles(rows: list[list[str]]) -> NDArray[Any]:
    try:
        table = np.array([row[:4] for row in rows], dtype=np.int64).reshape(len(rows), 4)
        if (table[:, 0] == 3).all():
            return table[:, 1:]
    except ValueError:
        pass
    raise next(error for i, row in enumerate(rows) if (error := _face_error(i, row)))


def _face_error(face: int, row: list[str]) -> MeshError | None:
    if not all(re.fullmatch(r"[+-]?\d+", word) for word in row[:4]):
        return MeshError(f"face {face} is {' '.join(row)!r}, wanted '3 i j k'")
    if row[0] != "3":
        return polygon_error(face, int(row[0]))
    if len(row) < 4:
        return MeshError(f"face {face} is {' '.join(row)!r}: the line is cut short")
    return None


def format_off(mesh: Mesh, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Write ASCII OFF, or COFF with colours (N, 3); coordinates are written so that they read back exactly."""
    points = [" ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    if colors is not None:
        points = [f"{p} {r} {g} {b} 255" for p, (r, g, b) in zip(points, colors.tolist(), strict=True)]
    faces = [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    head = ["OFF" if colors is None else "COFF", f"{mesh.n_vertices} {mesh.n_faces} 0"]
    return ("\n".join(head + points + faces) + "\n").encode("ascii")
