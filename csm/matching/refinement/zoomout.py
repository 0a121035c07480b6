"""The refinements of the field: ICP of functional maps, ZoomOut, and its bijective form.

Theirs is the adjoint form: vertex x of the source goes to the y whose row of Phi_t C^T is nearest to row x of Phi_s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from csm._counts import counted
from csm._types import IntArray
from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.functional import FunctionalMap
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import RefinedMap, Refiner
from csm.matching.refinement.batch import nearest_rows, orthogonal
from csm.matching.refinement.joint import first_matrix, least_squares, way_between
from csm.matching.refinement.pair import Pair


def zoomout_sizes(first: int, last: int, step: int, k: int) -> list[int]:
    """Return the sizes first, first + step, ... up to `last` that `k` eigenfunctions allow, the last included.

    Examples
    --------
    >>> zoomout_sizes(20, 50, 20, 45)
    [20, 40, 45]
    """
    last = min(last, k)
    return sorted({*range(min(first, last), last, step), last})


@dataclass(frozen=True)
class Growing(Refiner):
    """A refiner whose functional maps grow.

    Parameters
    ----------
    first, last, step
        Sizes of the functional maps.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.
    """

    first: int = 20
    last: int = 200
    step: int = 10

    def __post_init__(self) -> None:
        if not (2 <= self.first <= self.last and self.step >= 1):
            raise ConfigError(f"{self}: wanted 2 <= first <= last and step >= 1")

    def sizes(self, k: int) -> list[int]:
        """Return the sizes that `k` eigenfunctions allow, see `zoomout_sizes`."""
        return zoomout_sizes(self.first, self.last, self.step, k)


@dataclass(frozen=True)
class ZoomOut(Growing):
    """ZoomOut (Melzi et al. 2019, equations 1 and 2): functional maps of growing size, the descriptor only at first.

    Parameters
    ----------
    first, last, step
        See `Growing`.
    samples
        Vertices of each shape that all steps but the last are computed on (section 4.3 of the paper); 0 for all.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.
    """

    samples: int = 2500

    name: ClassVar[str] = "zoomout"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.samples < 0:
            raise ConfigError(f"{self}: wanted samples >= 0")

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined map."""
        pair = Pair.of(source, target)
        sizes = self.sizes(pair.k)
        matrix = first_matrix(start.indices, pair, sizes[0])
        here, areas = _drawn(pair, self.samples)
        there = _drawn(pair.reversed, self.samples)[0]
        candidates = torch.from_numpy(there).to(matrix.device)
        for size in sizes[1:]:
            queries, rows = adjoint_rows(matrix, pair)
            matrix = least_squares(pair, here, candidates[nearest_rows(queries[here], rows[there])], areas, size)
        text = f"refined by ZoomOut in {counted(len(sizes), 'step')}, to functional maps of {sizes[-1]} functions"
        return _result(matrix, pair, start, text, both=False)


@dataclass(frozen=True)
class ICP(Refiner):
    """Iterative closest points in the eigenfunctions (Ovsjanikov et al. 2012, section 6.2): orthogonal, of one size.

    Parameters
    ----------
    k
        Size of the functional map.
    iterations
        How often.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.
    """

    k: int = 50
    iterations: int = 10

    name: ClassVar[str] = "icp"

    def __post_init__(self) -> None:
        if self.k < 2 or self.iterations < 1:
            raise ConfigError(f"{self}: wanted k >= 2 and iterations >= 1")

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined map."""
        pair = Pair.of(source, target)
        k, everywhere = min(self.k, pair.k), np.arange(pair.source.mesh.n_vertices)
        matrix = orthogonal(first_matrix(start.indices, pair, k))
        for _ in range(self.iterations):
            queries, rows = adjoint_rows(matrix, pair)
            matrix = orthogonal(least_squares(pair, everywhere, nearest_rows(queries, rows), pair.source.areas, k))
        text = f"refined by {counted(self.iterations, 'round')} of ICP with functional maps of {k} functions"
        return _result(matrix, pair, start, text, both=True)


@dataclass(frozen=True)
class Bijective(Growing):
    """ZoomOut of the maps in both directions together (Ren et al. 2021, "Discrete Optimization for Shape Matching").

    Each step makes a functional map of both vertex maps, the second of them against its direction, so that they agree.
    """

    name: ClassVar[str] = "bijective"

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined maps of both directions."""
        pair = Pair.of(source, target)
        sizes = self.sizes(pair.k)
        matrix = first_matrix(start.indices, pair, sizes[0])
        for size in sizes[1:]:
            matrix = _agreeing(*_to_and_fro(matrix, pair), pair, size)
        text = (
            f"refined by bijective ZoomOut in {counted(len(sizes), 'step')}, to functional maps of {sizes[-1]} "
            "functions"
        )
        return _result(matrix, pair, start, text, both=True)


def adjoint_rows(matrix: Tensor, pair: Pair) -> tuple[Tensor, Tensor]:
    """Return the rows of both shapes that are compared under a functional map (K_s, K_t): Phi_s and Phi_t C^T."""
    rows, columns = matrix.shape
    return pair.source.evecs[:, :rows], pair.target.evecs[:, :columns] @ matrix.T


def _to_and_fro(matrix: Tensor, pair: Pair) -> tuple[Tensor, Tensor]:
    queries, rows = adjoint_rows(matrix, pair)
    return nearest_rows(queries, rows), nearest_rows(rows, queries)


def _agreeing(forward: Tensor, backward: Tensor, pair: Pair, k: int) -> Tensor:
    """Return the functional map that pulls back along both maps: [Phi_s; Phi_s(back)] C = [Phi_t(forth); Phi_t]."""
    phi, psi = pair.source.evecs[:, :k].double(), pair.target.evecs[:, :k].double()
    a, b = pair.source.areas[:, None].double(), pair.target.areas[:, None].double()
    back = phi[backward]
    left = (phi * a).T @ phi + (back * b).T @ back
    right = (phi * a).T @ psi[forward] + (back * b).T @ psi
    solved: Tensor = torch.linalg.solve(left, right)
    return solved.float()


def _drawn(pair: Pair, n: int) -> tuple[IntArray, Tensor]:
    if n == 0:
        return np.arange(pair.source.mesh.n_vertices), pair.source.areas
    samples = pair.source.samples(n)
    return samples.at, samples.areas


def _result(matrix: Tensor, pair: Pair, start: VertexMap, text: str, *, both: bool) -> RefinedMap:
    """Return the ways of a functional map: forth, and back where one matrix serves for both."""
    queries, rows = adjoint_rows(matrix, pair)
    names = (start.source, start.target)
    forward = way_between(queries, rows, pair, FunctionalMap(matrix.double().cpu().numpy(), *names))
    back = way_between(rows, queries, pair.reversed, None, names[::-1]) if both else None
    return RefinedMap(forward, back, text)
