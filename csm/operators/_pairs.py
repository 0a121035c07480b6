"""The sources to propagate geodesic distances from, for a list of vertex pairs, with the least work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class PairPlan:
    """Each source once, with all the targets that it is asked for.

    Parameters
    ----------
    sources
        Shape (S,).
    starts
        Shape (S + 1,): the targets of ``sources[i]`` are ``targets[starts[i]:starts[i + 1]]``.
    targets
        Shape (T,).
    inverse
        Shape (P,): the index in `targets` of each pair that was asked for.
    """

    sources: IntArray
    starts: IntArray
    targets: IntArray
    inverse: IntArray


def plan_pairs(vertices: FloatArray, sources: IntArray, targets: IntArray, symmetric: bool) -> PairPlan:
    """Group P pairs of vertices so that repeated pairs, and for a symmetric distance both directions, are done once.

    Parameters
    ----------
    vertices
        Shape (N, 3); a far pair costs more than a near one.
    sources, targets
        Shape (P,) each.
    symmetric
        Whether ``d(s, t) = d(t, s)``, so that either side may be the source.
    """
    n = len(vertices)
    first, second = (np.minimum(sources, targets), np.maximum(sources, targets)) if symmetric else (sources, targets)
    keys, inverse = np.unique(first * n + second, return_inverse=True)
    first, second = np.divmod(keys, n)
    if symmetric:
        swap = _cover(n, first, second, np.linalg.norm(vertices[first] - vertices[second], axis=1))
        first, second = np.where(swap, second, first), np.where(swap, first, second)
    order = np.argsort(first, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    unique, starts = np.unique(first[order], return_index=True)
    return PairPlan(unique, np.append(starts, len(order)), second[order], place[inverse])


def _cover(n: int, first: IntArray, second: IntArray, length: FloatArray) -> np.ndarray:
    """Choose the source side of each pair: a small vertex cover, far pairs first, since a propagation costs its area.

    The source of a near pair is the endpoint that is the source of a farther one already, else the one with more pairs.
    """
    octave = np.floor(np.log2(np.maximum(length, np.finfo(np.float64).tiny))).astype(np.int64)
    chosen = np.zeros(n, dtype=bool)
    swap = np.zeros(len(first), dtype=bool)
    for level in np.unique(octave)[::-1]:
        now = np.flatnonzero(octave == level)
        a, b = first[now], second[now]
        open_ = ~(chosen[a] | chosen[b])
        degree = np.bincount(a[open_], minlength=n) + np.bincount(b[open_], minlength=n)
        swap[now] = np.where(open_, degree[b] > degree[a], ~chosen[a])
        chosen[np.where(swap[now], b, a)] = True
    return swap
