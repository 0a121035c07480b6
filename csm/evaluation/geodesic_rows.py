"""Geodesic distances whose rows are kept in the store, so that the next method tested on the same shapes finds them."""

from __future__ import annotations

import numpy as np

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.shape import Mesh
from csm.operators.geodesic import EXACT_VERSION, Geodesics
from csm.operators.operators import Memo

FAR = 0.2
"""Pairs farther apart than this, in units of sqrt(area) and as the crow flies, ask for a row.

A propagation costs the area that it covers: for nearer pairs it is cheaper than to read a row.
"""

_ROUNDING = 1e-5  # of a length, in units of sqrt(area): rows are kept in single precision


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
        self._known: dict[int, FloatArray] = {}  # rows that were asked for, in single precision

    @property
    def method(self) -> str:
        """Of the distances: "exact", "heat" or "edge"."""
        return self._surface.method

    @property
    def _key(self) -> dict[str, object]:
        return {"method": self.method, **({"version": EXACT_VERSION} if self.method == "exact" else {})}

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

    def nearer(self, sources: IntArray, targets: IntArray, than: FloatArray) -> BoolArray:
        """Tell whether ``sources[i]`` is nearer to ``targets[i]`` than ``than[i]``, shape (P,).

        By the triangle inequality the rows that are known bound each distance from both sides, so that few pairs have
        to be measured; heat distances, which are not quite symmetric, do not keep it.
        """
        if self.method == "heat":
            return self.pairs(sources, targets) < than
        lower, upper = self._bounds(sources, targets)
        slack = _ROUNDING * np.sqrt(self._mesh.area)
        found: BoolArray = upper < than - slack
        open_ = np.flatnonzero(~found & (lower < than + slack))
        found[open_] = self.pairs(sources[open_], targets[open_]) < than[open_]
        return found

    def _bounds(self, sources: IntArray, targets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return a least and a greatest distance of each pair, both of shape (P,)."""
        lower, upper = np.zeros(len(sources)), np.full(len(sources), np.inf)
        for row in self._known.values():
            both = np.isfinite(row[sources]) & np.isfinite(row[targets])  # else the row is of another component
            here, there = row[sources[both]].astype(np.float64), row[targets[both]].astype(np.float64)
            lower[both] = np.maximum(lower[both], np.abs(here - there))
            upper[both] = np.minimum(upper[both], here + there)
        return lower, upper

    def diameter(self, max_rows: int = 8) -> float:
        """Estimate the largest distance from below; see `csm.operators.geodesic.Geodesics.diameter`."""
        params = {**self._key, "max_rows": max_rows}
        kept = self._memo.fetch(
            "geodesic-diameter", self._mesh, params, lambda: {"diameter": np.array(self._surface.diameter(max_rows))}
        )
        return float(kept["diameter"])

    def _row(self, source: int) -> FloatArray:
        kept = self._memo.fetch(
            "geodesic-row",
            self._mesh,
            {**self._key, "source": source},
            lambda: {"row": self._surface.rows(np.array([source]))[0].astype(np.float32)},
        )
        self._known[source] = kept["row"]
        return kept["row"].astype(np.float64)
