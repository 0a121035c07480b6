"""What every mesh parser returns, and helpers that parsers of text formats share."""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import MeshError


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Arrays as a file holds them, faces already 0-based, not yet checked against each other.

    Parameters
    ----------
    vertices
        Shape (N, 3).
    corners
        The vertices of all faces, one face after the other.
    sizes
        Shape (M,): how many corners each face has.
    notes
        What the parser noticed, one sentence each.
    """

    vertices: NDArray[Any]
    corners: NDArray[Any]
    sizes: NDArray[Any]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, vertices: NDArray[Any], faces: NDArray[Any], notes: tuple[str, ...] = ()) -> RawMesh:
        """Return a mesh whose faces, shape (M, n), have the same number n of corners each."""
        return cls(vertices, faces.reshape(-1), np.full(len(faces), faces.shape[1], dtype=np.int64), notes)

    @property
    def faces(self) -> NDArray[Any]:
        """The faces of a mesh whose faces have the same number of corners each, shape (M, n)."""
        return self.corners.reshape(len(self.sizes), int(self.sizes[0]) if len(self.sizes) else 3)


def decode(data: bytes) -> str:
    """Decode a text format, without its byte-order mark.

    Latin-1 accepts every byte, and only comments and names are ever outside of ASCII.  A text that begins with the
    mark of UTF-16 is decoded as such.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\0" in data:
        raise MeshError("this is a binary or damaged file, wanted text")
    return data.decode("latin-1")


def coordinates(rows: Sequence[Sequence[str]]) -> FloatArray:
    """Turn the words of the vertex lines into an (N, 3) array, dropping columns after the third.

    Raises
    ------
    MeshError
        If a line has fewer than three words or a word is not a number; the message counts vertices from 0.
    """
    try:
        return np.array([row[:3] for row in rows], dtype=np.float64).reshape(len(rows), 3)
    except ValueError:
        for i, row in enumerate(rows):
            if len(row) < 3 or not all(is_number(word) for word in row[:3]):
                raise MeshError(f"vertex {i} is {' '.join(row)[:80]!r}, wanted three numbers") from None
        raise


def strip_triangles(corners: IntArray, sizes: IntArray) -> tuple[IntArray, int]:
    """Return the triangles of strips, shape (M, 3), and how many were left out because they name a vertex twice.

    Parameters
    ----------
    corners
        The vertices of all strips, one strip after the other; -1 begins a new strip within one.
    sizes
        How many entries each strip has.
    """
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int64), 0
    begins = corners == -1
    begins[(np.cumsum(sizes) - sizes)[sizes > 0]] = True
    strip = np.cumsum(begins)
    # A strip that begins with the mark of a restart has its first corner one entry later.
    first = np.flatnonzero(begins) + (corners[begins] == -1)
    windows = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    inside = (strip[:-2] == strip[2:]) & (windows != -1).all(axis=1)
    odd = (np.arange(len(windows)) - first[strip[:-2] - 1]) % 2 == 1
    windows[odd] = windows[odd][:, [1, 0, 2]]
    triangles = windows[inside]
    a, b, c = triangles.T
    proper = (a != b) & (b != c) & (c != a)
    return triangles[proper], int((~proper).sum())


def is_number(word: str) -> bool:
    """Tell whether Python reads the word as a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def unread(n: int, unit: str, after: str) -> str:
    """Return the note on what follows the end of a file's content.

    Examples
    --------
    >>> unread(1, "line", "the last face")
    '1 line follows the last face; it was not read'
    """
    return counted(n, f"{unit} follows {after}; it was not read", f"{unit}s follow {after}; they were not read")
