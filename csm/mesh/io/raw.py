"""What every mesh parser returns, and helpers that parsers of text formats share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from csm._types import FloatArray
from csm.errors import MeshError


class RawMesh(NamedTuple):
    """Arrays as a file holds them, faces already 0-based, not yet checked against each other."""

    vertices: NDArray[Any]
    faces: NDArray[Any]


def decode(data: bytes) -> str:
    """Decode a text format; Latin-1 accepts every byte, and only comments are ever outside of ASCII."""
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
                raise MeshError(f"vertex {i} is {' '.join(row)!r}, wanted three numbers") from None
        raise


def polygon_error(face: int, n_corners: int) -> MeshError:
    """Return the error for a face that is not a triangle."""
    return MeshError(
        f"face {face} has {n_corners} corners, but csm reads triangle meshes only; triangulate the file first "
        "(in MeshLab: Turn into Pure-Triangular mesh)"
    )


def is_number(word: str) -> bool:
    """Tell whether Python reads the word as a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True
