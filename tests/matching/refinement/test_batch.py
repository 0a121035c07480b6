"""Steps of many maps at once, against loops over one map and all distances."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.distance import cdist

from csm.matching.refinement.batch import Guides, matrices_of, nearest_rows, orthogonal, scores, step
from csm.matching.refinement.pair import Pair, SampledPair
from tests.matching.pairs import known

B, K = 4, 9


@pytest.fixture(scope="module")
def sampled(store) -> SampledPair:
    found = known(store)
    return Pair.of(found.source, found.target).sampled(60)


@pytest.fixture(scope="module")
def maps(sampled) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(0).integers(0, len(sampled.target), (B, len(sampled.source))))


def dense(tensor: torch.Tensor) -> np.ndarray:
    return tensor.numpy().astype(float)


def one_matrix(indices: np.ndarray, pair: SampledPair, k: int) -> np.ndarray:
    roots = np.sqrt(dense(pair.source.areas))[:, None]
    phi, psi = dense(pair.source.evecs)[:, :k], dense(pair.target.evecs)[indices, :k]
    return np.linalg.lstsq(roots * phi, roots * psi, rcond=None)[0]


@pytest.mark.parametrize("shape", [(7,), (3, 5), (2, 3000)])
def test_nearest_rows_are_the_least_of_all_distances(shape):
    g = torch.Generator().manual_seed(0)
    queries, candidates = torch.randn(*shape, 6, generator=g), torch.randn(50, 6, generator=g)
    wanted = cdist(queries.reshape(-1, 6), candidates).argmin(1).reshape(shape)
    np.testing.assert_array_equal(nearest_rows(queries, candidates), wanted)


def test_functional_maps_are_least_squares_weighted_by_area(sampled, maps):
    found = matrices_of(maps, sampled, K)
    wanted = [one_matrix(indices, sampled, K) for indices in maps.numpy()]
    np.testing.assert_allclose(found, wanted, atol=1e-4)


def test_orthogonal_matrices_are_the_nearest():
    matrices = torch.randn(B, K, K, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    found = orthogonal(matrices)
    np.testing.assert_allclose(found @ found.mT, np.broadcast_to(np.eye(K), (B, K, K)), atol=1e-12)
    symmetric = found.mT @ matrices
    np.testing.assert_allclose(symmetric, symmetric.mT, atol=1e-12)
    assert (torch.linalg.eigvalsh(symmetric) > 0).all(), "the polar factor, not its mirror image"


def pulled_turns(matrix: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """n . (grad f_i x grad f_j) of the functions f = Phi C, by bilinearity; i < j in rows."""
    k = min(len(matrix), turns.shape[1])
    pairs = [(i, j) for i in range(k) for j in range(i + 1, k)]
    low = matrix[:k, :k]
    return np.array([[low[:, i] @ at[:k, :k] @ low[:, j] for i, j in pairs] for at in turns])


@pytest.mark.parametrize("guides", [Guides(0, 0), Guides(1.5, 0), Guides(0, 2), Guides(0.7, 1.2)])
def test_a_step_is_the_nearest_in_all_that_guides_it(sampled, guides):
    matrices = torch.randn(B, K, K, generator=torch.Generator().manual_seed(2))
    found = step(matrices, sampled, guides).numpy()
    phi, psi = dense(sampled.source.evecs)[:, :K], dense(sampled.target.evecs)[:, :K]
    target_turns = pulled_turns(np.eye(K), dense(sampled.target.turns))
    size = np.sqrt((dense(sampled.target.areas)[:, None] * target_turns**2).sum())
    for indices, matrix in zip(found, orthogonal(matrices.double()).numpy(), strict=True):
        squares = cdist(phi @ matrix, psi) ** 2 / K
        turned = pulled_turns(matrix, dense(sampled.source.turns))
        squares += guides.orientation**2 * cdist(turned, target_turns) ** 2 / size**2
        squares += guides.descriptor**2 * cdist(dense(sampled.features_source), dense(sampled.features_target)) ** 2
        chosen = squares[np.arange(len(indices)), indices]
        np.testing.assert_allclose(chosen, squares.min(1), rtol=1e-4, atol=1e-5)


def test_scores_are_those_of_one_map_at_a_time(sampled, maps):
    found = scores(maps, sampled, K)
    here, there = (dense(e.evals)[:K] for e in (sampled.pair.source, sampled.pair.target))
    areas = dense(sampled.source.areas) / dense(sampled.source.areas).sum()
    for b, indices in enumerate(maps.numpy()):
        c = one_matrix(indices, sampled, K)
        assert float(found.stretch[b]) == pytest.approx(np.linalg.norm(c.T @ c - np.eye(K)) / np.sqrt(K), rel=1e-3)
        size = np.sqrt(np.linalg.norm(here) * np.linalg.norm(there))
        gap = np.linalg.norm(c @ np.diag(there) - np.diag(here) @ c)
        assert float(found.commutation[b]) == pytest.approx(gap / size, rel=1e-3)
        apart = ((dense(sampled.features_source) - dense(sampled.features_target)[indices]) ** 2).sum(1)
        assert float(found.descriptor[b]) == pytest.approx(np.sqrt(areas @ apart), rel=1e-4)
    np.testing.assert_allclose(found.total, found.stretch + found.commutation + found.descriptor)


def test_the_true_map_has_the_best_score(store, sampled, maps):
    vertices, truth = sampled.pair.target.mesh.vertices, known(store).truth
    near = cdist(vertices[truth[sampled.source.at]], vertices[sampled.target.at]).argmin(1)
    judged = scores(torch.cat([maps, torch.from_numpy(near)[None]]), sampled, K)
    for each in (judged.stretch, judged.descriptor, judged.total):
        assert int(each.argmin()) == B
