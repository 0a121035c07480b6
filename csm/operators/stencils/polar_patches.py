"""The stencil "polar_patches", for GCNN: windows around each vertex, laid out in rings and rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from csm._types import Arrays, FloatArray, IntArray
from csm.errors import ConfigError
from csm.operators.geodesic import geodesics
from csm.operators.operators import Operators
from csm.operators.polar import PolarDiscs, polar_discs
from csm.operators.stencils.base import Stencil

_BLOCK = 512  # patches made at a time
_REACH = 1.5  # radii within which vertices count
_NEGLIGIBLE = 0.01  # of the greatest weight in a window


@dataclass(frozen=True)
class PolarPatches(Stencil):
    r"""Sparse weights that lay a function around a vertex out in S rings times T rays.

    With the geodesic polar coordinates (rho, theta) of vertex y around vertex x and the area a_y, the window of ring s
    and ray t weighs y by

    .. math:: v_{st}(x, y) \propto a_y \, \exp\left(-\frac{(\rho - \rho_s)^2}{2 (q w)^2}\right)
        \exp\left(-\frac{(\theta - \theta_t)^2}{2 (q \, 2 \pi / T)^2}\right), \qquad \sum_y v_{st}(x, y) = 1,

    for rings of width w = radius / S with the middles rho_s = (s - 1/2) w, and rays theta_t = 2 pi (t - 1) / T.
    Differences of angles are the shorter way around; x itself is on every ray.

    Parameters
    ----------
    radius
        Of the patch, as a fraction of the geodesic diameter (along edges).
    rings, rays
        S and T.
    spread
        q, width of the windows as a fraction of their distances.

    Raises
    ------
    ConfigError
        If `radius` or `spread` is not positive, or `rings` or `rays` is below 1.

    Notes
    -----
    Vertices up to 1.5 radii away count, and neighbours however far, so that no window is empty.  Weights below a
    hundredth of the greatest of a window are dropped.  Where vertices are far apart, a window has only the one that
    fits it best.

    The first ray points along the longest edge of the vertex.  A built-in human of 6899 vertices takes six seconds,
    and has 1.1 million weights (13 MB) with the radius of 0.01 that `csm.networks.GCNN` asks for.

    References
    ----------
    Masci, Boscaini, Bronstein, Vandergheynst, "Geodesic convolutional neural networks on Riemannian manifolds", 3dRR
    2015.
    """

    radius: float
    rings: int
    rays: int
    spread: float

    name: ClassVar[str] = "polar_patches"

    def __post_init__(self) -> None:
        if not self.radius > 0 or not self.spread > 0 or self.rings < 1 or self.rays < 1:
            raise ConfigError(f"{self}: wanted radius > 0, spread > 0, rings >= 1 and rays >= 1")

    def __call__(self, operators: Operators) -> Arrays:
        """Return the weights as one matrix in CSR form, row (x S + s) T + t for window s, t of vertex x.

        The arrays are `indptr` (N S T + 1,), `indices` and `values` (nnz,).
        """
        mesh = operators.mesh
        radius = self.radius * geodesics(mesh, "edge").diameter(max_rows=100)
        discs = polar_discs(mesh, _REACH * radius)
        starts = range(0, mesh.n_vertices, _BLOCK)
        blocks = [np.arange(start, min(start + _BLOCK, mesh.n_vertices)) for start in starts]
        parts = [self._windows(discs, centres, operators.mass, radius) for centres in blocks]
        return {
            "indptr": np.concatenate([[0], np.cumsum(np.concatenate([part.counts for part in parts]))]),
            "indices": np.concatenate([part.vertices for part in parts]).astype(np.int32),
            "values": np.concatenate([part.weights for part in parts]).astype(np.float32),
        }

    def _windows(self, discs: PolarDiscs, centres: IntArray, areas: FloatArray, radius: float) -> _Windows:
        """Return the windows of some vertices that follow each other."""
        entries = slice(discs.indptr[centres[0]], discs.indptr[centres[-1] + 1])
        own = np.zeros(len(centres))
        local = np.arange(len(centres))
        row = np.concatenate([local, np.repeat(local, np.diff(discs.indptr)[centres])])
        order = np.argsort(row, kind="stable")
        row, vertex = row[order], np.concatenate([centres, discs.vertices[entries]])[order]
        rho = np.concatenate([own, discs.radii[entries]])[order]
        theta = np.concatenate([own + np.nan, discs.angles[entries]])[order]
        logs = self._log_weights(rho, theta, radius)
        logs += np.log(np.maximum(areas[vertex], np.finfo(np.float64).tiny))[:, None]
        starts = np.searchsorted(row, np.arange(len(centres)))
        weights = np.exp(logs - np.maximum.reduceat(logs, starts)[row])
        weights[weights < _NEGLIGIBLE] = 0.0
        weights /= np.add.reduceat(weights, starts)[row]
        entry, window = np.nonzero(weights)
        key = row[entry] * weights.shape[1] + window
        order = np.argsort(key, kind="stable")
        counts = np.bincount(key, minlength=len(centres) * weights.shape[1])
        return _Windows(counts, vertex[entry][order], weights[entry, window][order])

    def _log_weights(self, rho: FloatArray, theta: FloatArray, radius: float) -> FloatArray:
        """Return the logarithms of the windows, without areas, at P places, (P, S T); a theta of NaN is on all rays."""
        across = rho[:, None] / radius * self.rings - (np.arange(self.rings) + 0.5)
        turns = np.nan_to_num(theta[:, None] / (2 * np.pi) - np.arange(self.rays) / self.rays)
        around = np.where(np.isnan(theta)[:, None], 0.0, (turns + 0.5) % 1.0 - 0.5) * self.rays
        squares = across[:, :, None] ** 2 + around[:, None, :] ** 2
        logs: FloatArray = -squares.reshape(len(rho), -1) / (2 * self.spread**2)
        return logs


class _Windows(NamedTuple):
    """How many weights each window has, (W,), and of each weight the vertex and the value, (nnz,)."""

    counts: IntArray
    vertices: IntArray
    weights: FloatArray
