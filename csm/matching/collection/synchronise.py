r"""Maps of a collection that agree around every cycle: C_ij = Y_i Y_j^T of one orthogonal matrix per shape.

A functional map C_ij takes coefficients on shape j to those on shape i, so the vertex maps i -> j -> k give C_ij C_jk.
Maps that close every cycle have the form C_ij = Y_i Y_j^T, where Y_i takes coefficients on a latent shape to those on
shape i (Wang, Huang, Guibas, "Image Co-Segmentation via Consistent Functional Maps", 2013; Huang et al., "Limit
Shapes", 2019).  The best such form of given maps,

.. math:: \max_{Y_i \in O(K)} \sum_{ij} w_{ij} \langle C_{ij}, Y_i Y_j^\top \rangle,

is found as usual in synchronisation over the orthogonal group: the first K eigenvectors of the block matrix of the
w_ij C_ij, divided by the degrees (Singer, "Angular synchronization", 2011; Huang et al., "Consistent ZoomOut", 2020),
then Y_i <- the polar factor of sum_j w_ij C_ij Y_j (the generalised power method: Boumal 2016, Ling 2022).

Wrong maps are outliers, often with limbs exchanged.  They are voted out: the loss of a map that is far from the
agreement is bounded (Geman and McClure), in the choice among the candidates of each edge as well as in the weights of
the synchronisation (iteratively reweighted least squares; Chatterjee and Govindu, "Efficient and Robust Large-Scale
Rotation Averaging", 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from csm._types import FloatArray, IntArray
from csm.matching.collection.graph import triangles_of
from csm.matching.functional import orthogonal

SCALE = 0.25
"""Distance of two maps, see `apart`, from which on an edge counts little."""

_ROUNDS = 6  # of moving every shape, and of choosing candidates, weights and bases in turn, at most
_TREES = 6  # spanning trees at random that the search begins with, besides two
_POWERS = 40  # steps of the power method for the eigenvectors
_POLISHES = 6  # steps of the generalised power method
_TRUST = 0.3  # what complete disagreement costs, in units of the scores of candidates


@dataclass(frozen=True, eq=False)
class Agreement:
    """What the maps of a collection agree on.

    Parameters
    ----------
    bases
        Shape (n, K, K), orthogonal: coefficients on the latent shape to those on each shape.
    choice
        Shape (E,): which candidate of each edge was taken.
    apart
        Shape (E,): the distance of that candidate from the agreement, from 0 to sqrt(2).
    """

    bases: FloatArray
    choice: IntArray
    apart: FloatArray

    def map(self, i: int, j: int) -> FloatArray:
        """Return the functional map (K, K) of the map i -> j."""
        matrix: FloatArray = self.bases[i] @ self.bases[j].T
        return matrix


def apart(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return |A - B| / sqrt(2 K) of orthogonal matrices (..., K, K): 0 for equal ones, about 1 for unrelated ones.

    Examples
    --------
    >>> bool(np.isclose(apart(np.eye(3), -np.eye(3)), 2**0.5))
    True
    """
    k = first.shape[-1]
    distance: FloatArray = np.sqrt(((first - second) ** 2).sum((-2, -1)) / (2 * k))
    return distance


def composed(bases: FloatArray, pairs: IntArray) -> FloatArray:
    """Return the maps Y_i Y_j^T of pairs (E, 2), shape (E, K, K)."""
    maps: FloatArray = bases[pairs[:, 0]] @ bases[pairs[:, 1]].transpose(0, 2, 1)
    return maps


def triangle_errors(maps: FloatArray, pairs: IntArray, n: int) -> tuple[IntArray, FloatArray]:
    """Return the triangles of a graph, see `triangles_of`, and |C_ij C_jk - C_ik| / sqrt(2 K) of each."""
    triangles = triangles_of(pairs, n)
    ij, jk, ik = maps[triangles].transpose(1, 0, 2, 3) if len(triangles) else np.zeros((3, 0, *maps.shape[1:]))
    return triangles, apart(ij @ jk, ik)


def synchronise(maps: FloatArray, pairs: IntArray, weights: FloatArray, n: int) -> FloatArray:
    """Return the bases (n, K, K) whose maps Y_i Y_j^T fit given maps best.

    Parameters
    ----------
    maps
        Shape (E, K, K), orthogonal.
    pairs
        Shape (E, 2), the edges of a connected graph.
    weights
        Shape (E,), positive.
    n
        Number of shapes.
    """
    k = maps.shape[-1]
    scale = 1 / np.sqrt(_degrees(pairs, weights, n))
    matrix = np.zeros((n, k, n, k))
    scaled = maps * (weights * scale[pairs[:, 0]] * scale[pairs[:, 1]])[:, None, None]
    matrix[pairs[:, 0], :, pairs[:, 1], :] = scaled
    matrix[pairs[:, 1], :, pairs[:, 0], :] = scaled.transpose(0, 2, 1)
    flat = matrix.reshape(n * k, n * k)
    vectors = (along_tree(maps, pairs, weights, n) / scale[:, None, None]).reshape(n * k, k)
    for _ in range(_POWERS):  # of flat + 1, whose eigenvalues are not negative
        vectors = np.linalg.qr(flat @ vectors + vectors)[0]
    return polished(orthogonal(vectors.reshape(n, k, k)), maps, pairs, weights)


def polished(bases: FloatArray, maps: FloatArray, pairs: IntArray, weights: FloatArray) -> FloatArray:
    """Return bases (n, K, K) after some steps Y_i <- polar factor of Y_i + sum_j w_ij C_ij Y_j / sum_j w_ij."""
    degrees = _degrees(pairs, weights, len(bases))[:, None, None]
    for _ in range(_POLISHES):
        total = np.zeros_like(bases)
        np.add.at(total, pairs[:, 0], weights[:, None, None] * (maps @ bases[pairs[:, 1]]))
        np.add.at(total, pairs[:, 1], weights[:, None, None] * (maps.transpose(0, 2, 1) @ bases[pairs[:, 0]]))
        bases = orthogonal(bases + total / degrees)
    return bases


def along_tree(maps: FloatArray, pairs: IntArray, weights: FloatArray, n: int) -> FloatArray:
    """Return the bases (n, K, K) that fit the maps of the spanning tree of greatest weight exactly; the first is 1."""
    lengths = 1 + (weights.max() - weights)
    tree = minimum_spanning_tree(coo_matrix((lengths, pairs.T), shape=(n, n)))
    number = np.full((n, n), -1)
    number[pairs[:, 0], pairs[:, 1]] = number[pairs[:, 1], pairs[:, 0]] = np.arange(len(pairs))
    order, before = breadth_first_order(tree, 0, directed=False)
    bases = np.tile(np.eye(maps.shape[-1]), (n, 1, 1))
    for i in order[1:]:
        j = before[i]
        edge = maps[number[i, j]]
        bases[i] = (edge if i < j else edge.T) @ bases[j]
    return bases


def agree(candidates: FloatArray, costs: FloatArray, pairs: IntArray, n: int) -> Agreement:
    """Choose one of several candidates for the map of each edge so that cycles close, and synchronise them.

    Sought is the least sum over the edges of the cost of a candidate, above the least of its edge, and of `_TRUST`
    times the robust distance of that candidate from the agreement.  From several spanning trees, every shape in turn
    goes to where the candidates of its edges place it best (iterated conditional modes); the best end is synchronised.

    Parameters
    ----------
    candidates
        Shape (E, c, K, K), orthogonal.
    costs
        Shape (E, c): how bad each is by itself; infinite for what is no candidate.
    pairs
        Shape (E, 2), the edges of a connected graph.
    n
        Number of shapes.
    """
    gaps = costs - costs.min(1, keepdims=True)
    best = candidates[np.arange(len(pairs)), costs.argmin(1)]
    ends = [_placed(along_tree(best, pairs, w, n), candidates, gaps, pairs) for w in _tree_weights(costs)]
    bases = min(ends, key=lambda end: _objective(apart(candidates, composed(end, pairs)[:, None]), gaps).sum())
    each = np.arange(len(pairs))
    for step in range(_ROUNDS):
        choice, away = _chosen(bases, candidates, gaps, pairs)
        maps, weights = candidates[each, choice], robust(away)
        bases = polished(bases, maps, pairs, weights) if step else synchronise(maps, pairs, weights, n)
    return Agreement(bases, *_chosen(bases, candidates, gaps, pairs))


def _chosen(
    bases: FloatArray, candidates: FloatArray, gaps: FloatArray, pairs: IntArray
) -> tuple[IntArray, FloatArray]:
    """Return the candidate of each edge that adds least to the sum that is sought, and its distance."""
    error = apart(candidates, composed(bases, pairs)[:, None])
    choice: IntArray = (gaps + _TRUST * _loss(error)).argmin(1)
    return choice, error[np.arange(len(pairs)), choice]


def _tree_weights(costs: FloatArray) -> list[FloatArray]:
    """Return the weights of the edges in the trees to begin with: sure ones first, cheap ones first, and at random."""
    inner = np.sort(np.where(np.isfinite(costs), costs, costs[np.isfinite(costs)].max() + 1), axis=1)
    margin = inner[:, min(1, inner.shape[1] - 1)] - inner[:, 0]
    rng = np.random.default_rng(0)
    return [margin, -inner[:, 0], *(margin * rng.random(len(costs)) for _ in range(_TREES))]


def _placed(bases: FloatArray, candidates: FloatArray, gaps: FloatArray, pairs: IntArray) -> FloatArray:
    """Move every shape in turn to the place that its edges like best, until none moves."""
    bases, k = bases.copy(), bases.shape[-1]
    around = [np.flatnonzero((pairs == i).any(1)) for i in range(len(bases))]
    for _ in range(_ROUNDS):
        moved = False
        for i, edges in enumerate(around):
            begins = pairs[edges, 0] == i
            maps = np.where(begins[:, None, None, None], candidates[edges], candidates[edges].transpose(0, 1, 3, 2))
            others = np.where(begins, pairs[edges, 1], pairs[edges, 0])
            votes = maps @ bases[others][:, None]  # (e, c, K, K): where each candidate of each edge places shape i
            places = np.concatenate([bases[i][None], votes[np.isfinite(gaps[edges])]]).reshape(-1, k * k)
            inner = np.einsum("pk,eck->pec", places, votes.reshape(*votes.shape[:2], -1), optimize=True) / k
            totals = _objective(np.sqrt(np.maximum(1 - inner, 0)), gaps[edges]).sum(1)
            best = int(totals.argmin())
            if totals[best] < totals[0] - 1e-9:
                bases[i], moved = places[best].reshape(k, k), True
        if not moved:
            break
    return bases


def _objective(error: FloatArray, gaps: FloatArray) -> FloatArray:
    """Return what each edge adds to the sum that is sought, (...), of distances (..., c) of its candidates."""
    least: FloatArray = (gaps + _TRUST * _loss(error)).min(-1)
    return least


def _loss(error: FloatArray) -> FloatArray:
    """Return the loss of Geman and McClure, from 0 to 1."""
    square: FloatArray = (error / SCALE) ** 2
    return square / (1 + square)


def robust(error: FloatArray, scale: float = SCALE) -> FloatArray:
    """Return the weights of Geman and McClure, at least 1e-4 so that the graph stays connected.

    Examples
    --------
    >>> robust(np.array([0.0, 1.0]), scale=1.0)
    array([1.  , 0.25])
    """
    weights: FloatArray = np.maximum(1 / (1 + (error / scale) ** 2) ** 2, 1e-4)
    return weights


def _degrees(pairs: IntArray, weights: FloatArray, n: int) -> FloatArray:
    return np.bincount(pairs.ravel(), np.repeat(weights, 2), n).astype(np.float64)
