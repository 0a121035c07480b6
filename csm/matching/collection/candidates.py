"""Candidates for the map of each edge of a collection: what several starts end at, and what the other shapes say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from csm._types import FloatArray
from csm.matching.functional import orthogonal
from csm.matching.refinement.batch import nearest_rows
from csm.matching.refinement.joint import least_squares
from csm.matching.refinement.multistart import Multistart
from csm.matching.refinement.pair import Pair

_SAMPLES = 2500  # vertices of the source whose nearest neighbours make a start


@dataclass(frozen=True, eq=False)
class Candidates:
    """What may be the map of one edge.

    Parameters
    ----------
    maps
        Shape (c, K, K), orthogonal.
    costs
        Shape (c,): how bad each is by itself (`csm.matching.refinement.batch.Scores.total`); infinite for none.
    """

    maps: FloatArray
    costs: FloatArray


def search(pair: Pair, refiner: Multistart, k: int) -> Candidates:
    """Return the different maps of size k that a search with several starts ends at, the best first.

    The first start is that of the descriptor's nearest neighbours, at samples of the source.
    """
    samples = pair.source.samples(_SAMPLES)
    near = nearest_rows(pair.features_source[samples.at], pair.features_target)
    first = least_squares(pair, samples.at, near, samples.areas, min(pair.k, refiner.first))
    return _candidates(refiner.starts(first), pair, refiner, k, searched=False)


def judge(maps: FloatArray, pair: Pair, refiner: Multistart, k: int) -> Candidates:
    """Refine given maps (c, K, K) and return them with their costs, as `search` does."""
    given = torch.from_numpy(np.ascontiguousarray(maps)).float().to(pair.source.device)
    return _candidates(given, pair, refiner, k, searched=True)


def _candidates(starts: Tensor, pair: Pair, refiner: Multistart, k: int, *, searched: bool) -> Candidates:
    found = refiner.finals(starts, pair) if searched else refiner.solutions(starts, pair)
    order = found.scores.total.argsort()
    maps = found.matrices[order][:, :k, :k].double().cpu().numpy()
    return Candidates(orthogonal(maps), found.scores.total[order].double().cpu().numpy())


def stacked(candidates: list[Candidates]) -> Candidates:
    """Return the candidates of E edges as arrays (E, c, K, K) and (E, c); missing ones cost infinitely much."""
    most = max(len(one.costs) for one in candidates)
    k = candidates[0].maps.shape[-1]
    maps = np.tile(np.eye(k), (len(candidates), most, 1, 1))
    costs = np.full((len(candidates), most), np.inf)
    for i, one in enumerate(candidates):
        maps[i, : len(one.costs)], costs[i, : len(one.costs)] = one.maps, one.costs
    return Candidates(maps, costs)


def joined(first: Candidates, second: Candidates) -> Candidates:
    """Return the candidates of two searches over the same edges together."""
    return Candidates(np.concatenate([first.maps, second.maps], 1), np.concatenate([first.costs, second.costs], 1))
