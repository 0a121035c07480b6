"""Consistent upsampling: the maps of all edges become finer together, and close every cycle at each size.

As in Consistent ZoomOut (Huang et al. 2020), every step goes from the consistent maps Y_i Y_j^T of size K to vertex
maps of the edges, from these to functional maps of the next size, and from these to consistent ones again.  As in
`csm.matching.refinement.joint`, vertices are compared by eigenfunctions and descriptor together.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from csm._types import FloatArray, IntArray
from csm.matching.collection.synchronise import along_tree, apart, composed, polished, robust
from csm.matching.functional import orthogonal
from csm.matching.refinement.batch import nearest_rows
from csm.matching.refinement.joint import Climb, least_squares
from csm.matching.refinement.pair import Pair

SIZES = (60, 100)
"""Sizes of the consistent maps after the first; from the last on, every pair climbs by itself."""

_SAMPLES = 1000  # vertices of each shape that are mapped to the other
_ROUNDS = 3  # of weights and bases in turn


def finer(matrix: FloatArray, pair: Pair, climb: Climb, k: int) -> FloatArray:
    """Return the functional map of size k, orthogonal, of the vertex maps there and back of a smaller one (K, K)."""
    given = torch.from_numpy(np.ascontiguousarray(matrix)).float().to(pair.source.device)
    there = _step(given, pair, climb, k)
    back = _step(given.T.contiguous(), pair.reversed, climb, k)
    return orthogonal((there + back.T).double().cpu().numpy())


def _step(matrix: Tensor, pair: Pair, climb: Climb, k: int) -> Tensor:
    samples = pair.source.samples(_SAMPLES)
    queries, candidates = climb.rows(matrix, pair)
    return least_squares(pair, samples.at, nearest_rows(queries[samples.at], candidates), samples.areas, k)


def consistent(maps: FloatArray, pairs: IntArray, scale: float, n: int) -> FloatArray:
    """Return the bases (n, K, K) of maps that nearly agree, without a search for wrong ones.

    Parameters
    ----------
    maps
        Shape (E, K, K), orthogonal.
    pairs
        Shape (E, 2), the edges of a connected graph.
    scale
        Distance, see `csm.matching.collection.synchronise.apart`, from which on an edge counts little.
    n
        Number of shapes.
    """
    weights = np.ones(len(pairs))
    bases = along_tree(maps, pairs, weights, n)
    for _ in range(_ROUNDS):
        bases = polished(bases, maps, pairs, weights)
        weights = robust(apart(maps, composed(bases, pairs)), scale)
    return bases
