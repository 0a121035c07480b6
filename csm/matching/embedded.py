"""A shape as refinements see it: its Laplace-Beltrami eigenfunctions, at all vertices and at samples of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from csm._types import FloatArray, IntArray
from csm.matching.orientation import spectral_turns
from csm.mesh.debris import body_of
from csm.mesh.shape import Mesh
from csm.operators.spectrum import Spectrum

if TYPE_CHECKING:
    import torch
    from torch import Tensor

MOST = 200
"""Eigenfunctions that refinements use at most."""

CROSSED = 8
"""Eigenfunctions whose gradients are crossed, which tells a map from its mirror image."""

SPREAD = 2500
"""Vertices that samples are taken from."""

_SMOOTH = 60  # eigenfunctions that these crossed gradients are projected on


def n_eigenfunctions(mesh: Mesh) -> int:
    """Return how many eigenfunctions refinements use of a mesh: 200, or a fifth of its vertices if that is less.

    Examples
    --------
    >>> import csm
    >>> n_eigenfunctions(csm.load_humans().mesh("s00_p00"))
    200
    """
    return max(min(MOST, mesh.n_vertices // 5), min(mesh.n_vertices, CROSSED + 2))


@dataclass(frozen=True, eq=False)
class Samples:
    """Vertices spread evenly over a shape.

    Parameters
    ----------
    at
        Shape (p,): the vertices.
    areas
        Shape (p,): area of the vertices that are nearest to each sample; they sum to the area of the shape.
    evecs
        Shape (p, K), float32.
    turns
        Shape (p, k, k), float32: n . (grad phi_i x grad phi_j) of the first k eigenfunctions, see
        `csm.matching.orientation`.
    """

    at: IntArray
    areas: Tensor
    evecs: Tensor
    turns: Tensor

    def __len__(self) -> int:
        return len(self.at)


class Embedded:
    """A mesh with its eigenfunctions, in the form that refinements compute with.

    Parameters
    ----------
    mesh
        The shape at unit area.
    spectrum
        Its K eigenpairs.
    device
        Where the tensors are.
    order
        Vertices spread over the shape, see `spread_vertices`; computed if they are not given.
    """

    def __init__(
        self,
        mesh: Mesh,
        spectrum: Spectrum,
        device: str | torch.device = "cpu",
        order: IntArray | None = None,
    ) -> None:
        self.mesh, self.spectrum, self.device = mesh, spectrum, device
        self.order = spread_vertices(mesh) if order is None else order
        self._samples: dict[int, Samples] = {}

    @property
    def k(self) -> int:
        """K, the number of eigenfunctions."""
        return len(self.spectrum.evals)

    @cached_property
    def evecs(self) -> Tensor:
        """Shape (N, K), float32."""
        return self._tensor(self.spectrum.evecs)

    @cached_property
    def evals(self) -> Tensor:
        """Shape (K,), float32."""
        return self._tensor(self.spectrum.evals)

    @cached_property
    def areas(self) -> Tensor:
        """Vertex areas, shape (N,), float32."""
        return self._tensor(self.spectrum.mass)

    @cached_property
    def _turns(self) -> FloatArray:
        return spectral_turns(self.mesh, self.spectrum, min(CROSSED, self.k), min(_SMOOTH, self.k))

    def samples(self, n: int) -> Samples:
        """Return `n` samples, or the whole `order` if that is shorter."""
        if n not in self._samples:
            usable = np.flatnonzero(self.spectrum.mass > 0)
            at = self.order[:n]
            owner = cKDTree(self.mesh.vertices[at]).query(self.mesh.vertices[usable])[1]
            areas = np.bincount(owner, self.spectrum.mass[usable], minlength=len(at)).astype(np.float64)
            self._samples[n] = Samples(at, self._tensor(areas), self.evecs[at], self._tensor(self._turns[at]))
        return self._samples[n]

    def _tensor(self, values: FloatArray) -> Tensor:
        import torch

        return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32)).to(self.device)


def spread_vertices(mesh: Mesh, n: int = SPREAD) -> IntArray:
    """Return `n` vertices of a mesh without its debris, the first of which are spread evenly however many one takes.

    Of a mesh with fewer vertices all are returned.
    """
    usable = np.flatnonzero(body_of(mesh).vertices)
    found: IntArray = usable[farthest_points(mesh.vertices[usable], n)]
    return found


def farthest_points(points: FloatArray, n: int) -> IntArray:
    """Return the numbers of `n` points, each the farthest (Euclidean) from those before it.

    The first is the farthest from the mean, so nothing is random.

    Parameters
    ----------
    points
        Shape (N, 3).
    n
        All points are returned if there are not more.

    Examples
    --------
    >>> farthest_points(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [9, 0, 0]]), 2)
    array([3, 0])
    """
    n = min(n, len(points))
    chosen = np.empty(n, dtype=np.int64)
    distance = np.full(len(points), np.inf)
    at = int(((points - points.mean(0)) ** 2).sum(1).argmax())
    axes = np.ascontiguousarray(points.T)
    rest, away = np.empty((2, len(points)))  # squared distances along one axis, and along those so far
    for i in range(n):
        chosen[i] = at
        away[:] = 0
        for axis in axes:
            np.subtract(axis, axis[at], out=rest)
            np.multiply(rest, rest, out=rest)
            np.add(away, rest, out=away)
        np.minimum(distance, away, out=distance)
        distance[at] = -1.0  # chosen once, also where others lie at the same place
        at = int(distance.argmax())
    return chosen
