"""Several starts and a choice: the maps that the eigenfunctions' signs allow, refined, and the best of them.

A map between two poses is nearly perfect or has limbs exchanged: which of the two is decided by the start.  In the
first K eigenfunctions the map of a pair of similar bodies is close to diagonal, so only the signs are open (Ren et al.,
"MapTree: Recovering Multiple Solutions in the Space of Maps", 2020).  So every choice of the first signs is a start,
alone and applied to the functional map of the descriptor's nearest neighbours.  All are refined together at some
hundred samples, guided by the descriptor and, against mirrored maps, by the orientation of the surfaces
(`csm.matching.orientation`).  The best that differ go on to finer functional maps at more samples, and the one that
then keeps areas, lengths and the descriptor best (`Scores.total`) climbs to all vertices.

Where another of them, clearly different, is nearly that of an isometry as well, the shapes look the same in several
ways (`Solutions.ambiguous`): a torus turned about its axis, a sheet turned by half, a body and its mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import torch
from torch import Tensor

from csm._counts import counted
from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import RefinedMap, Refiner
from csm.matching.refinement.batch import Guides, Scores, matrices_of, nearest_rows, orthogonal, scores, step
from csm.matching.refinement.joint import SCHEDULE, Climb, finished, first_matrix
from csm.matching.refinement.pair import Pair, SampledPair

_SEARCH = (8, 10, 12, 15, 18, 22, 26, 30, 30)  # sizes of the functional maps of the search
_UNGUIDED = 3  # of these steps, the last ones, which the orientation does not guide
_KEPT = 32  # starts that these are made with, the best ones so far
_FINAL_SAMPLES = 1000  # vertices of each shape that the choice is made at
_FINAL = (30, 40, 60, 100)  # sizes of the functional maps before the choice
_APART = 0.5  # |C - C'| / sqrt(K) from which two functional maps are different maps
_CLEARLY_APART = 1.0  # the same, of a map that is another symmetry; unrelated orthogonal maps have 1.41
_ISOMETRIC = 0.35  # stretch and commutation up to which a map is nearly an isometry
_TIED, _ISOMETRIC_TIED = 0.01, 0.5  # the same, of a map whose sum of scores is that of the best up to the first
_STRAINED = 1.5  # sum of the scores of a map that cannot be right; right ones of humans and animals had 1.2 or less
_DESCRIBED = 0.5  # how much worse the descriptor may be kept, whose total variance is 1


@dataclass(frozen=True, eq=False)
class Solutions:
    """The different maps that a search ends at.

    Parameters
    ----------
    matrices
        Shape (c, K, K): their functional maps.
    scores
        What is known of each without ground truth.
    """

    matrices: Tensor
    scores: Scores

    @property
    def best(self) -> int:
        """Number of the one to take."""
        return int(self.scores.total.argmin())

    @property
    def ambiguous(self) -> bool:
        """Whether a map that is clearly another one than the best could be the right one as well.

        Its stretch and commutation are nearly those of an isometry.  Symmetric shapes, meshed alike or not, have such
        maps at 0.14 to 0.34, coarse ones up to 0.5 with scores that tie; the best other map of 30 pairs of humans and
        animals was at 0.42 and more, and 0.05 worse than the best in the sum of its scores.
        """
        best, judged = self.best, self.scores
        apart = (self.matrices - self.matrices[best]).flatten(1).norm(dim=1) / self.matrices.shape[-1] ** 0.5
        most = torch.where(judged.total <= judged.total[best] + _TIED, _ISOMETRIC_TIED, _ISOMETRIC)
        isometric = judged.stretch + judged.commutation <= most
        described = judged.descriptor <= judged.descriptor[best] + _DESCRIBED
        return bool(((apart >= _CLEARLY_APART) & isometric & described).any())

    @property
    def strained(self) -> bool:
        """Whether even the best one keeps areas, lengths and the descriptor too badly to be right."""
        return bool(self.scores.total[self.best] > _STRAINED)


@dataclass(frozen=True, eq=False)
class Chosen:
    """The start that is made fine.

    Parameters
    ----------
    matrix
        Its functional map, (K, K) for the first K of the schedule.
    text
        What was done, in words.
    ambiguous, strained
        See `Solutions.ambiguous` and `Solutions.strained`.
    """

    matrix: Tensor
    text: str
    ambiguous: bool
    strained: bool


@dataclass(frozen=True)
class Multistart(Refiner):
    """Refine many starts at samples, choose the best, and refine it at all vertices.

    Parameters
    ----------
    signs
        How many of the first eigenfunctions have each sign in turn (the first is constant and has one): 2^(signs - 1)
        choices.
    samples
        Vertices of each shape that starts are refined at.
    descriptor, orientation
        Weights of the descriptor and of the pseudo-scalars against the eigenfunctions in the search.
    finalists
        How many different maps of the search go on to the choice.
    schedule, weight
        Of the climb, see `csm.matching.refinement.joint.Joint`.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Examples
    --------
    >>> Multistart().name
    'multistart'
    """

    signs: int = 6
    samples: int = 500
    descriptor: float = 1.0
    orientation: float = 2.0
    finalists: int = 4
    schedule: tuple[int, ...] = SCHEDULE
    weight: float = 1.0

    name: ClassVar[str] = "multistart"

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", self.climb.schedule)
        if not 1 <= self.signs <= _SEARCH[0] or self.samples < 10 or self.finalists < 1:
            raise ConfigError(f"{self}: wanted signs from 1 to {_SEARCH[0]}, samples >= 10 and finalists >= 1")
        if not (self.descriptor >= 0 and self.orientation >= 0):
            raise ConfigError(f"{self}: wanted weights of at least 0")

    @property
    def first(self) -> int:
        """Size of the functional maps that a search starts with."""
        return _SEARCH[0]

    @property
    def climb(self) -> Climb:
        """How the chosen start becomes finer."""
        return Climb(self.schedule, self.weight)

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined map of the best start."""
        pair = Pair.of(source, target)
        chosen = self.search(start, pair)
        done = finished(self.climb(chosen.matrix, pair), pair, self.climb, start, chosen.text)
        return replace(done, ambiguous=chosen.ambiguous, strained=chosen.strained)

    def search(self, start: VertexMap, pair: Pair) -> Chosen:
        """Return the best start."""
        starts = self.starts(first_matrix(start.indices, pair, min(pair.k, self.first)))
        found = self.solutions(starts, pair)
        best, judged = found.best, found.scores
        text = (
            f"the best of {counted(len(starts), 'start')} and {counted(len(found.matrices), 'map', 'different maps')} "
            f"of them (stretch {float(judged.stretch[best]):.2f}, commutation {float(judged.commutation[best]):.2f}, "
            f"descriptor {float(judged.descriptor[best]):.2f}), refined jointly with the descriptor to functional maps "
            f"of {self.climb.sizes(pair.k)[-1]} functions"
        )
        return Chosen(found.matrices[best], text, found.ambiguous, found.strained)

    def solutions(self, starts: Tensor, pair: Pair) -> Solutions:
        """Refine functional maps to begin with, (B, K, K), and return the best that differ, see `finals`."""
        sampled = pair.sampled(self.samples)
        largest = min(pair.k, len(sampled.source), len(sampled.target))
        sizes = [size for size in _SEARCH if size <= largest] or [largest]
        maps = self._refine(starts, sampled, sizes)
        order = scores(maps, sampled, sizes[-1]).total.argsort()
        return self.finals(_different(matrices_of(maps[order], sampled, sizes[-1]), self.finalists), pair)

    def finals(self, matrices: Tensor, pair: Pair) -> Solutions:
        """Refine functional maps (c, K, K) at more samples; return them, of the first size of the climb, and scores."""
        climb = Climb(_FINAL, self.weight, samples=_FINAL_SAMPLES, candidates=_FINAL_SAMPLES)
        sampled, k = pair.sampled(_FINAL_SAMPLES), climb.sizes(pair.k)[-1]
        maps = []
        for matrix in matrices:
            queries, candidates = climb.rows(climb(matrix, pair), pair)
            maps.append(nearest_rows(queries[sampled.source.at], candidates[sampled.target.at]))
        together = torch.stack(maps)
        first = min(self.climb.sizes(pair.k)[0], k)
        return Solutions(matrices_of(together, sampled, first), scores(together, sampled, k))

    def starts(self, matrix: Tensor) -> Tensor:
        """Return the functional maps (B, K, K) to begin with, made of that of a start, (K, K)."""
        k = len(matrix)
        flips = torch.ones(2 ** (min(self.signs, k) - 1), k, device=matrix.device)
        for row, chosen in enumerate(product((1.0, -1.0), repeat=min(self.signs, k) - 1)):
            flips[row, 1 : 1 + len(chosen)] = torch.tensor(chosen)
        flipped = flips[:, :, None]
        return torch.cat([flipped * torch.eye(k, device=matrix.device), flipped * orthogonal(matrix), matrix[None]])

    def _refine(self, matrices: Tensor, sampled: SampledPair, sizes: list[int]) -> Tensor:
        guided, free = Guides(self.descriptor, self.orientation), Guides(self.descriptor, 0.0)
        maps = step(matrices, sampled, guided)
        n_guided = max(1, len(sizes) - _UNGUIDED)
        for size in sizes[:n_guided]:
            maps = step(matrices_of(maps, sampled, size), sampled, guided)
        maps = maps[scores(maps, sampled, sizes[n_guided - 1]).total.argsort()[:_KEPT]]
        for size in sizes[n_guided:]:
            maps = step(matrices_of(maps, sampled, size), sampled, free)
        return maps


def _different(matrices: Tensor, most: int) -> Tensor:
    """Return up to `most` functional maps that differ from each other, of those in order (B, K, K)."""
    kept: list[int] = []
    size = matrices.shape[-1] ** 0.5
    for i in range(len(matrices)):
        if all(float((matrices[i] - matrices[j]).norm()) > _APART * size for j in kept):
            kept.append(i)
        if len(kept) == most:
            break
    return matrices[kept]
