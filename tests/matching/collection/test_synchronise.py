from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.linalg import expm

from csm.matching.collection.graph import pairs_of
from csm.matching.collection.synchronise import (
    agree,
    along_tree,
    apart,
    composed,
    synchronise,
    triangle_errors,
)
from csm.matching.functional import orthogonal as polar

N, K = 7, 6
ALL = np.array(list(combinations(range(N), 2)))


def orthogonal(n: int, seed: int) -> np.ndarray:
    return polar(np.random.default_rng(seed).normal(size=(n, K, K)))


def noisy(maps: np.ndarray, size: float, seed: int = 5) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=maps.shape) * size
    return np.stack([one @ expm(turn - turn.T) for one, turn in zip(maps, noise, strict=True)])


@pytest.fixture
def truth() -> np.ndarray:
    return composed(orthogonal(N, 0), ALL)


def test_polar_is_the_nearest_of_many_orthogonal_matrices():
    matrix = np.random.default_rng(1).normal(size=(K, K))
    best = np.linalg.norm(polar(matrix) - matrix)
    assert all(np.linalg.norm(one - matrix) >= best for one in orthogonal(200, 2))
    assert all(np.linalg.norm(one - matrix) >= best for one in noisy(np.tile(polar(matrix), (200, 1, 1)), 0.01))


def test_consistent_maps_are_found_again(truth):
    bases = synchronise(truth, ALL, np.ones(len(ALL)), N)
    assert np.allclose(bases @ bases.transpose(0, 2, 1), np.eye(K))
    assert np.allclose(composed(bases, ALL), truth, atol=1e-8)
    tree = along_tree(truth, ALL, np.ones(len(ALL)), N)
    assert np.allclose(composed(tree, ALL), truth)


def test_noise_is_averaged_as_by_the_dense_eigenvectors(truth):
    given = noisy(truth, 0.05)
    dense = np.zeros((N, K, N, K))
    for (i, j), one in zip(ALL, given, strict=True):
        dense[i, :, j], dense[j, :, i] = one, one.T
    vectors = np.linalg.eigh(dense.reshape(N * K, N * K))[1][:, -K:].reshape(N, K, K)
    spectral = apart(composed(polar(vectors), ALL), truth).mean()
    found = apart(composed(synchronise(given, ALL, np.ones(len(ALL)), N), ALL), truth).mean()
    assert found < 0.8 * apart(given, truth).mean()
    assert found < 1.02 * spectral


def test_the_sum_that_is_sought_cannot_be_improved_by_small_turns(truth):
    given, weights = noisy(truth, 0.1), np.random.default_rng(3).random(len(ALL)) + 0.5

    def fit(bases: np.ndarray) -> float:
        return float((weights * (composed(bases, ALL) * given).sum((1, 2))).sum())

    bases = synchronise(given, ALL, weights, N)
    assert all(fit(noisy(bases, 0.02, seed)) < fit(bases) + 1e-6 for seed in range(30))


def test_a_map_with_exchanged_limbs_is_mended_by_the_others(truth):
    exchange = np.eye(K)[[0, 2, 1, 3, 5, 4]]
    given = noisy(truth, 0.02)
    given[3] = given[3] @ exchange
    found = agree(given[:, None], np.ones((len(ALL), 1)), ALL, N)
    assert apart(composed(found.bases, ALL), truth).max() < 0.1
    assert found.apart.argmax() == 3
    assert found.apart[3] > 0.5
    i, j = ALL[3]
    assert np.allclose(found.map(i, j), composed(found.bases, ALL)[3])


def test_of_several_candidates_those_are_taken_with_which_cycles_close(truth):
    wrong = composed(orthogonal(N, 9), ALL[::-1])
    mirror = truth @ np.diag([1.0, -1, 1, -1, 1, 1])
    candidates = np.stack([wrong, mirror, truth], axis=1)
    costs = np.tile([1.3, 1.1, 1.0], (len(ALL), 1))
    costs[[2, 8, 11], 1] = 0.95  # three pairs look better mirrored
    alone = candidates[np.arange(len(ALL)), costs.argmin(1)]
    found = agree(candidates, costs, ALL, N)
    assert (found.choice == 2).all()
    before, after = (triangle_errors(maps, ALL, N)[1] for maps in (alone, composed(found.bases, ALL)))
    assert before.max() > 0.5
    assert after.max() < 1e-6


def test_what_is_no_candidate_is_never_taken(truth):
    candidates = np.stack([truth, np.tile(np.eye(K), (len(ALL), 1, 1))], axis=1)
    costs = np.column_stack([np.ones(len(ALL)), np.full(len(ALL), np.inf)])
    found = agree(candidates, costs, ALL, N)
    assert (found.choice == 0).all()
    assert np.allclose(composed(found.bases, ALL), truth, atol=1e-6)


def test_a_sparse_graph_carries_maps_to_pairs_without_an_edge():
    n, bases = 20, polar(np.random.default_rng(4).normal(size=(20, K, K)))
    pairs = pairs_of(np.random.default_rng(5).random((n, n)) * 0 + 1, 3, 2)
    given = noisy(composed(bases, pairs), 0.02)
    broken = np.arange(0, len(pairs), 9)
    given[broken] = composed(polar(np.random.default_rng(6).normal(size=(n, K, K))), pairs[broken])
    found = agree(given[:, None], np.ones((len(pairs), 1)), pairs, n)
    every = np.array(list(combinations(range(n), 2)))
    assert apart(composed(found.bases, every), composed(bases, every)).max() < 0.15


def test_triangle_errors_are_those_of_brute_force(truth):
    given = noisy(truth, 0.3)
    edges = [tuple(pair) for pair in ALL.tolist()]
    triangles, errors = triangle_errors(given, ALL, N)
    for (ij, jk, ik), error in zip(triangles, errors, strict=True):
        (i, j), (_, k) = edges[ij], edges[jk]
        assert edges[ik] == (i, k)
        gap = given[edges.index((i, j))] @ given[edges.index((j, k))] - given[edges.index((i, k))]
        assert np.isclose(error, np.linalg.norm(gap) / np.sqrt(2 * K))
    assert len(errors) == 35
    assert len(triangle_errors(given[:1], ALL[:1], 2)[1]) == 0
