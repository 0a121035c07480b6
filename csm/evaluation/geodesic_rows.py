"""Geodesic distances whose rows are kept in the store, so that the next method tested on the same shapes finds them."""

from __future__ import annotations

import numpy as np

from csm._types import FloatArray, IntArray
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Geodesics
from csm.operators.operators import Memo

FAR = 0.2
"""Pairs farther apart than this, in units of sqrt(area) and as the crow flies, ask for a row.

A propagation costs the area that it covers: for nearer pairs it is cheaper than to read a row.
"""


class StoredGeodesics:
    """Distances on one mesh that keep the rows from which far pairs were asked for.

    Bad matches are what an evaluation spends its time on: the distance to one is a propagation over most of the shape.
    As every method is asked about the same points, its row serves all of them.

    Parameters
    ----------
    surface
        What measures.
    mesh
        The mesh that it measures on.
    memo
        Where rows and diameters are kept, in single precision.
    """

    def __init__(self, surface: Geodesics, mesh: Mesh, memo: Memo) -> None:
        self._surface, self._mesh, self._memo = surface, mesh, memo

    @property
    def method(self) -> str:
        """Of the distances: "exact", "heat" or "edge"."""
        return self._surface.method

    def rows(self, sources: IntArray) -> FloatArray:
        """Return distances from each of S sources to all vertices, shape (S, N)."""
        return np.array([self._row(int(source)) for source in sources]).reshape(len(sources), self._mesh.n_vertices)

    def pairs(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return the distance from ``sources[i]`` to ``targets[i]``, shape (P,)."""
        straight = np.linalg.norm(self._mesh.vertices[sources] - self._mesh.vertices[targets], axis=1)
        far = np.unique(sources[straight > FAR * np.sqrt(self._mesh.area)])
        near = ~np.isin(sources, far)
        out = np.empty(len(sources))
        out[near] = self._surface.pairs(sources[near], targets[near])
        for source in far:
            here = sources == source
            out[here] = self._row(int(source))[targets[here]]
        return out

    def diameter(self, max_rows: int = 8) -> float:
        """Estimate the largest distance from below; see `csm.operators.geodesic.Geodesics.diameter`."""
        params = {"method": self.method, "max_rows": max_rows}
        kept = self._memo.fetch(
            "geodesic-diameter", self._mesh, params, lambda: {"diameter": np.array(self._surface.diameter(max_rows))}
        )
        return float(kept["diameter"])

    def _row(self, source: int) -> FloatArray:
        kept = self._memo.fetch(
            "geodesic-row",
            self._mesh,
            {"method": self.method, "source": source},
            lambda: {"row": self._surface.rows(np.array([source]))[0].astype(np.float32)},
        )
        return kept["row"].astype(np.float64)
