"""Maps between two shapes, with their direction in the name: from each vertex of the source to one of the target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._types import IntArray
from csm.errors import DataError


@dataclass(frozen=True, eq=False)
class VertexMap:
    """A map source -> target: for each vertex of the source a vertex of the target.

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
        given = np.asarray(self.indices)
        wrong = given.ndim != 1 or given.dtype.kind not in "iu"
        if wrong or given.min(initial=0) < -1 or given.max(initial=-1) >= self.n_target:
            raise DataError(
                f"{self.source} -> {self.target}: the map is {given.dtype} of shape {given.shape}; wanted a vector of "
                f"integers in 0..{self.n_target - 1}, or -1 where nothing is known"
            )
        object.__setattr__(self, "indices", given.astype(np.int64))

    @property
    def coverage(self) -> float:
        """Fraction of the target's vertices that some vertex is mapped to."""
        return len(np.unique(self.indices[self.indices >= 0])) / self.n_target

    @property
    def n_unmatched(self) -> int:
        """Number of vertices of the source without a partner (-1)."""
        return int((self.indices < 0).sum())

    def __repr__(self) -> str:
        return f"VertexMap({self.source} -> {self.target}, {len(self.indices)} to {self.n_target} vertices)"
