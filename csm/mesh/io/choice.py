"""Which shape of a file that holds several."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from csm._counts import counted
from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh

Choice: TypeAlias = "int | str | None"
"""The number of the shape, counted from 0, "all" for all of them joined, or None where there has to be one only."""


def chosen(names: Sequence[str], choose: Choice) -> list[int]:
    """Return the numbers of the shapes that are asked for.

    Raises
    ------
    MeshError
        If there are several and none is chosen, or there is none of that number.
    """
    if choose == "all" or (choose is None and len(names) == 1):
        return list(range(len(names)))
    shown = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    if choose is None:
        raise MeshError(
            f"it holds {counted(len(names), 'shape')} ({shown}), wanted one; choose it by its number from 0 to "
            f"{len(names) - 1}, "
            'as in csm.read_mesh(..., choose=0) or csm clean FILE OUT choose=0, or choose="all" to join them'
        )
    try:
        number = operator.index(choose)  # type: ignore[arg-type]
    except TypeError:
        number = -1
    if not 0 <= number < len(names):
        raise MeshError(
            f"there is no choose={choose!r}: it holds {counted(len(names), 'shape')} ({shown}), counted from 0"
        )
    return [number]


def joined(shapes: Sequence[RawMesh]) -> RawMesh:
    """Return shapes as one, their vertices and faces in their order; nothing is merged."""
    if len(shapes) == 1:
        return shapes[0]
    counts = [len(shape.vertices) for shape in shapes]
    firsts = np.cumsum(counts) - counts
    corners = [shape.corners + first for shape, first in zip(shapes, firsts, strict=True)]
    notes = tuple(dict.fromkeys(note for shape in shapes for note in shape.notes))
    return RawMesh(
        np.concatenate([shape.vertices for shape in shapes]),
        np.concatenate(corners),
        np.concatenate([shape.sizes for shape in shapes]),
        (*notes, f"{len(shapes)} shapes were joined, of {', '.join(map(str, counts[:10]))} vertices"),
    )
