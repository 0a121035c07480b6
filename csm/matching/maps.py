"""Maps between two shapes, with their direction in the name: from each vertex of the source to one of the target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from csm._counts import counted
from csm._types import IntArray
from csm.errors import DataError


@dataclass(frozen=True, eq=False)
class VertexMap:
    """A map source -> target: for each vertex of the source a vertex of the target.

    ``numpy.asarray(vertex_map)`` is `indices`.

    Parameters
    ----------
    indices
        Shape (N_source,), 0-based: entry i is the vertex of the target that vertex i of the source goes to; -1 where
        none was asked for.
    n_target
        Number of vertices of the target.
    source, target
        Names of the shapes.

    Raises
    ------
    DataError
        If the indices are no vector of integers in -1..n_target-1.

    Examples
    --------
    >>> VertexMap(np.array([2, 0, 2]), 4, "a", "b")
    VertexMap(a -> b, 3 to 4 vertices)
    """

    indices: IntArray
    n_target: int
    source: str = "source"
    target: str = "target"

    def __post_init__(self) -> None:
        indices = numbers_or_none(self.indices, self.n_target, f"{self.source} -> {self.target}: the map is")
        object.__setattr__(self, "indices", indices)

    @property
    def coverage(self) -> float:
        """Fraction of the target's vertices that some vertex is mapped to."""
        return len(np.unique(self.indices[self.indices >= 0])) / self.n_target

    @property
    def n_unmatched(self) -> int:
        """Number of vertices of the source without a partner (-1)."""
        return int((self.indices < 0).sum())

    def compose(self, other: VertexMap) -> VertexMap:
        """Return the map that goes first along this one, A -> B, and then along another, B -> C.

        Raises
        ------
        DataError
            If the other map does not begin where this one ends: it is of another number of vertices.

        Examples
        --------
        >>> there, back = VertexMap(np.array([2, 0, -1]), 4, "a", "b"), VertexMap(np.array([1, 0, 0, 2]), 3, "b", "a")
        >>> there.compose(back).indices
        array([ 0,  1, -1])
        """
        if len(other) != self.n_target:
            raise DataError(
                f"{self.source} -> {self.target} ends at {counted(self.n_target, 'vertex')}, and {other.source} -> "
                f"{other.target} begins at {len(other)}: one cannot follow the other"
            )
        indices = np.where(self.indices >= 0, other.indices[self.indices], -1) if len(other) else self.indices
        return VertexMap(indices, other.n_target, self.source, other.target)

    def __len__(self) -> int:
        return len(self.indices)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False and dtype is not None and np.dtype(dtype) != self.indices.dtype:
            raise ValueError(f"a map of {self.indices.dtype} becomes {np.dtype(dtype)} only as a copy")
        return np.array(self.indices, dtype=dtype) if copy else np.asarray(self.indices, dtype=dtype)

    def __repr__(self) -> str:
        return f"VertexMap({self.source} -> {self.target}, {len(self.indices)} to {counted(self.n_target, 'vertex')})"


def numbers_or_none(values: ArrayLike, n: int, what: str) -> IntArray:
    """Return the numbers of things that are counted from 0 to n - 1, -1 for none, as int64; `what` begins an error.

    Raises
    ------
    DataError
        If they are no vector of such integers.

    Examples
    --------
    >>> numbers_or_none([2, -1], 3, "a -> b: the map is")
    array([ 2, -1])
    """
    given = np.asarray(values)
    wrong = given.ndim != 1 or given.dtype.kind not in "iu"
    if wrong or given.min(initial=0) < -1 or given.max(initial=-1) >= n:
        raise DataError(
            f"{what} {given.dtype} of shape {given.shape}; wanted a vector of integers in 0..{n - 1}, or -1 where "
            "nothing is known"
        )
    return given.astype(np.int64)
