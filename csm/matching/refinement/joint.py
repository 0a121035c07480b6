"""Joint refinement: ZoomOut's climb to finer functional maps, with the descriptor in every step.

ZoomOut (Melzi et al., "ZoomOut: Spectral Upsampling for Efficient Shape Correspondence", 2019) goes to and fro between
a functional map of K x K and a vertex map with growing K.  Two things are done here that it does not: the nearest
neighbour is taken in [eigenfunctions, descriptor], so that the precision of the descriptor is kept, and the functional
map is made orthogonal, as that of a map that keeps areas is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.matching.barycentric import BarycentricMap, nearest_on_faces
from csm.matching.base import Described
from csm.matching.functional import FunctionalMap
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import RefinedMap, Refiner
from csm.matching.refinement.batch import nearest_rows, orthogonal
from csm.matching.refinement.clusters import nearest_of_many
from csm.matching.refinement.pair import Pair
from csm.matching.signals import SAMPLES
from csm.matching.way import Way

SCHEDULE = (30, 40, 60, 100, 150, 200)
"""Sizes of the functional maps, one after the other."""


@dataclass(frozen=True)
class Climb:
    """How a functional map becomes finer.

    Parameters
    ----------
    schedule
        Sizes K in order; those beyond the eigenfunctions of a shape are left out.
    weight
        Of the descriptor against the eigenfunctions; both have a total variance of 1.
    orthogonal
        Whether the functional map is made orthogonal at each size.
    samples
        Vertices of the source that all sizes but the last are computed on.
    candidates
        Vertices of the target that they can go to in all sizes but the last.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.
    """

    schedule: tuple[int, ...] = SCHEDULE
    weight: float = 1.0
    orthogonal: bool = True
    samples: int = 2500
    candidates: int = 10000

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", tuple(self.schedule))
        if not self.schedule or min(self.schedule) < 2 or list(self.schedule) != sorted(self.schedule):
            raise ConfigError(f"{self.schedule}: wanted a schedule of ascending sizes from 2")
        if not self.weight >= 0 or self.samples < 10 or self.candidates < 10:
            raise ConfigError(f"{self}: wanted weight >= 0, samples >= 10 and candidates >= 10")

    def sizes(self, k: int) -> list[int]:
        """Return the sizes that `k` eigenfunctions allow, at least one."""
        return [size for size in self.schedule if size <= k] or [k]

    def __call__(self, matrix: Tensor, pair: Pair) -> Tensor:
        """Climb from a functional map of the first size, (K, K), to one of the last; return that."""
        sizes = self.sizes(pair.k)
        s = pair.source.samples(self.samples)
        n = pair.target.mesh.n_vertices
        there = np.arange(n) if n <= self.candidates else pair.target.samples(self.candidates).at
        here, found = s.at, torch.from_numpy(there).to(matrix.device)
        for i in range(len(sizes) - 1):
            queries, candidates = self.rows(matrix, pair)
            at = found[nearest_rows(queries[here], candidates[there])]
            matrix = least_squares(pair, here, at, s.areas, sizes[i + 1])
        return matrix

    def rows(self, matrix: Tensor, pair: Pair) -> tuple[Tensor, Tensor]:
        """Return what vertices of the source and of the target are compared by, under a functional map (K, K)."""
        if self.orthogonal:
            matrix = orthogonal(matrix)
        k = matrix.shape[-1]
        here = pair.source.evecs[:, :k] @ (matrix / k**0.5)
        there = pair.target.evecs[:, :k] / k**0.5
        if self.weight == 0:
            return here, there
        return (
            torch.cat([here, self.weight * pair.features_source], 1),
            torch.cat([there, self.weight * pair.features_target], 1),
        )


def least_squares(pair: Pair, here: IntArray, there: Tensor, areas: Tensor, k: int) -> Tensor:
    """Return the functional map (k, k) of a map from vertices `here` of the source to `there` of the target."""
    phi, psi = pair.source.evecs[here, :k].double(), pair.target.evecs[there, :k].double()
    weighted = phi * areas[:, None].double()
    solved: Tensor = torch.linalg.solve(weighted.T @ phi, weighted.T @ psi)
    return solved.float()


@dataclass(frozen=True)
class Joint(Refiner):
    """Refine one start by functional maps of growing size, with the descriptor in every step.

    Parameters
    ----------
    schedule
        Sizes of the functional maps, ascending.
    weight
        Of the descriptor against the eigenfunctions; 0 leaves it out.
    orthogonal
        Whether the functional maps are made orthogonal.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Examples
    --------
    >>> Joint(weight=0.5).parameters()["weight"]
    0.5
    """

    schedule: tuple[int, ...] = SCHEDULE
    weight: float = 1.0
    orthogonal: bool = True

    name: ClassVar[str] = "joint"

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", self.climb.schedule)

    @property
    def climb(self) -> Climb:
        """The same as a `Climb`."""
        return Climb(self.schedule, self.weight, self.orthogonal)

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined map."""
        pair = Pair.of(source, target)
        matrix = first_matrix(start.indices, pair, self.climb.sizes(pair.k)[0])
        return finished(self.climb(matrix, pair), pair, self.climb, start, _text(self.climb.sizes(pair.k)))


def first_matrix(indices: IntArray, pair: Pair, k: int) -> Tensor:
    """Return the functional map (k, k) of a map that is known at samples of the source, or at other vertices of it."""
    samples = pair.source.samples(SAMPLES)
    known = indices[samples.at] >= 0
    here = samples.at[known] if known.all() else np.flatnonzero(indices >= 0)
    if len(here) < k:
        raise ConfigError(
            f"a map that is known at {counted(len(here), 'vertex')} cannot be refined; wanted {k} at least"
        )
    areas = samples.areas if known.all() else pair.source.areas[here]
    return least_squares(pair, here, torch.from_numpy(indices[here]).to(areas.device), areas, k)


def finished(matrix: Tensor, pair: Pair, climb: Climb, start: VertexMap, text: str) -> RefinedMap:
    """Return the ways of the last functional map of a climb."""
    here, there = climb.rows(matrix, pair)
    if climb.orthogonal:
        matrix = orthogonal(matrix)
    c: FloatArray = matrix.double().cpu().numpy()
    names = (start.source, start.target)
    forward = way_between(here, there, pair, FunctionalMap(c, *names))
    back = FunctionalMap(c.T, *names[::-1]) if climb.orthogonal else None
    return RefinedMap(forward, way_between(there, here, pair.reversed, back, names[::-1]), text)


def way_between(
    queries: Tensor,
    candidates: Tensor,
    pair: Pair,
    functional: FunctionalMap | None,
    names: tuple[str, str] | None = None,
) -> Way:
    """Return the way on which every vertex goes to the nearest of the target's rows, or to a point of its faces.

    Parameters
    ----------
    queries, candidates
        Shapes (N_source, D) and (N_target, D): what vertices are compared by.
    pair
        The shapes, in this direction.
    functional
        The functional map, which has the names of the shapes.
    names
        These names, where there is no functional map.
    """
    source, target = names or ((functional.source, functional.target) if functional else ("source", "target"))
    faces = pair.target.mesh.faces

    def precise() -> BarycentricMap:
        rows, points = queries.double().cpu().numpy(), candidates.double().cpu().numpy()
        return replace(nearest_on_faces(rows, points, faces), source=source, target=target)

    nearest = nearest_of_many(queries, candidates, pair.target.order)
    found = VertexMap(nearest.cpu().numpy(), pair.target.mesh.n_vertices, source, target)
    return Way(found, functional, precise=precise)


def _text(sizes: Sequence[int]) -> str:
    steps = counted(len(sizes), "step")
    return f"refined jointly with the descriptor in {steps}, to functional maps of {sizes[-1]} functions"
