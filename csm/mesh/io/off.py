"""The OFF format: http://www.geomview.org/docs/html/OFF.html, with the variants that are met in shape data sets."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from csm._counts import counted
from csm._types import IntArray
from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh, coordinates, decode, unread
from csm.mesh.shape import Mesh

# The optional prefixes (texture, colour, normal) only add columns after x y z.  ModelNet glues the counts to "OFF".
# Case matters: N stands for normals, n for n dimensions.
_KEYWORD = re.compile(r"(?:(?P<texture>ST)?(?P<colour>C)?(?P<normal>N)?)(?P<dimension>4?n?)OFF|(?P<small>c)?off")
_WRAPPED = "its lines are wrapped (one vertex or face is spread over several); it was read number by number"


def parse_off(data: bytes) -> RawMesh:
    """Read an ASCII OFF, COFF, NOFF, CNOFF or STOFF file; faces may have any number of corners.

    Counts may stand on the line of the keyword or on their own, the keyword may be missing, comments and blank lines
    may stand anywhere, and extra columns and lines after the last face are ignored.  A file that makes no sense line
    by line is read number by number, and that reading counts if it uses every number.

    Raises
    ------
    MeshError
        If the file is binary, cut short or not three-dimensional.
    """
    if re.match(rb"(\xef\xbb\xbf)?\s*\w*OFF\s+BINARY", data[:64]):
        raise MeshError("this is a binary OFF file, which csm does not read; save it as ASCII OFF or as PLY")
    text = _without_comments(decode(data))
    rows = _rows(text)
    try:
        return _by_lines(rows)
    except MeshError:
        wrapped = _by_numbers(rows)
        if wrapped is None:
            raise
        return wrapped


def count_off(data: bytes) -> int:
    """Return the number of vertices that the head of an OFF file announces."""
    return _take_counts(_rows(_without_comments(decode(data))))[0]


def _without_comments(text: str) -> str:
    return re.sub(r"#[^\r\n]*", "", text) if "#" in text else text


def _rows(text: str) -> list[list[str]]:
    """Return the words of every line that has any."""
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
    if len(head) < 2 or not all(_is_count(word) for word in head[:2]):
        raise MeshError(f"wanted 'OFF' and the numbers of vertices and faces, found {' '.join(head)[:60]!r}")
    return int(head[0]), int(head[1])


def _is_count(word: str) -> bool:
    return re.fullmatch(r"\d{1,20}", word, re.ASCII) is not None


def _by_lines(rows: list[list[str]]) -> RawMesh:
    rows = list(rows)
    n_vertices, n_faces = _take_counts(rows)
    end = n_vertices + n_faces
    if len(rows) < end:
        raise MeshError(
            f"the header announces {counted(n_vertices, 'vertex')} and {counted(n_faces, 'face')}, but only "
            f"{counted(len(rows), 'line follows', 'lines follow')}: "
            "the file is cut short"
        )
    vertices = coordinates(rows[:n_vertices])
    corners, sizes = _faces(rows[n_vertices:end])
    notes = (unread(len(rows) - end, "line", "the last face"),) if len(rows) > end else ()
    return RawMesh(vertices, corners, sizes, notes)


def _faces(rows: Sequence[Sequence[str]]) -> tuple[IntArray, IntArray]:
    """Return the corners of all faces and how many each has; the words after a face's corners are its colour."""
    try:
        triangles = np.array([row[:4] for row in rows], dtype=np.int64).reshape(len(rows), 4)
        if (triangles[:, 0] == 3).all():
            return triangles[:, 1:].ravel(), triangles[:, 0]
    except (ValueError, OverflowError):
        pass
    corners: list[int] = []
    sizes: list[int] = []
    for face, row in enumerate(rows):
        size = int(row[0]) if re.fullmatch(r"\d{1,9}", row[0], re.ASCII) else 0
        if size == 0 or not all(re.fullmatch(r"[+-]?\d{1,18}", word, re.ASCII) for word in row[1 : size + 1]):
            raise MeshError(f"face {face} is {' '.join(row)[:80]!r}, wanted the number of its corners, then these")
        if len(row) <= size:
            raise MeshError(f"face {face} is {' '.join(row)[:80]!r}: the line is cut short")
        sizes.append(size)
        corners += map(int, row[1 : size + 1])
    return np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64)


def _by_numbers(rows: Sequence[Sequence[str]]) -> RawMesh | None:
    """Read a file without regard to its lines; None unless that uses every number in it."""
    words = [word for row in rows for word in row]
    keyword = _KEYWORD.match(words[0]) if words else None
    columns, head = 3, len(rows[0]) if rows else 0
    if keyword:
        glued = words[0][keyword.end() :]
        words = [glued, *words[1:]] if glued else words[1:]
        head = head - (not glued) or (len(rows[1]) if len(rows) > 1 else 0)
        columns += 2 * bool(keyword["texture"]) + 4 * bool(keyword["colour"] or keyword["small"])
        columns += 3 * bool(keyword["normal"])
    n_counts = 2 if head == 2 else 3  # the number of edges may be missing
    if len(words) < n_counts or not all(map(_is_count, words[:n_counts])):
        return None
    return _counted(words[n_counts:], int(words[0]), int(words[1]), columns)


def _counted(words: list[str], n_vertices: int, n_faces: int, columns: int) -> RawMesh | None:
    end = columns * n_vertices
    if end + n_faces > len(words) or (end == 0 and n_faces == 0):
        return None
    try:
        vertices = np.array(words[:end], dtype=np.float64).reshape(n_vertices, columns)[:, :3]
        numbers = np.array(words[end:], dtype=np.int64)
    except (ValueError, OverflowError):
        return None
    heads = [0]
    while len(heads) <= n_faces and heads[-1] < len(numbers) and numbers[heads[-1]] > 0:
        heads.append(heads[-1] + 1 + int(numbers[heads[-1]]))
    if len(heads) != n_faces + 1 or heads[-1] != len(numbers):
        return None
    sizes = numbers[heads[:-1]]
    return RawMesh(vertices, np.delete(numbers, heads[:-1]), sizes, (_WRAPPED,))


def format_off(mesh: Mesh, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Write ASCII OFF, or COFF with colours (N, 3); coordinates are written so that they read back exactly."""
    points = [" ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    if colors is not None:
        points = [f"{p} {r} {g} {b} 255" for p, (r, g, b) in zip(points, colors.tolist(), strict=True)]
    faces = [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    head = ["OFF" if colors is None else "COFF", f"{mesh.n_vertices} {mesh.n_faces} 0"]
    return ("\n".join(head + points + faces) + "\n").encode("ascii")
