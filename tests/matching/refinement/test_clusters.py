from __future__ import annotations

import numpy as np
import pytest
import torch

import csm
from csm.data.store import Store
from csm.matching.embedded import farthest_points
from csm.matching.refinement.batch import nearest_rows
from csm.matching.refinement.clusters import nearest_of_many


def surface(n: int, seed: int) -> torch.Tensor:
    """Points of a smooth surface in twelve dimensions."""
    u, v = np.random.default_rng(seed).random((2, n)) * 2 * np.pi
    rows = [f(k * x) / k for k in (1, 2, 3) for x in (u, v) for f in (np.sin, np.cos)]
    return torch.tensor(np.stack(rows, axis=1), dtype=torch.float32)


def test_clusters_find_what_looking_everywhere_finds():
    queries, candidates = surface(3000, 0), surface(4000, 1)
    seeds = farthest_points(candidates.double().numpy(), 200)
    found = nearest_of_many(queries, candidates, seeds, large=0)
    wanted = nearest_rows(queries, candidates)
    assert (found == wanted).float().mean() > 0.999
    assert torch.equal(nearest_of_many(queries, candidates, seeds), wanted)


def test_every_candidate_finds_itself():
    candidates = surface(500, 2)
    found = nearest_of_many(candidates, candidates, np.arange(0, 500, 10), large=0)
    assert torch.equal(found, torch.arange(500))


def test_rows_that_rounding_cannot_tell_apart_still_find_themselves():
    candidates = 1000 + surface(500, 2)
    assert not torch.equal(nearest_rows(candidates, candidates), torch.arange(500))
    assert torch.equal(nearest_of_many(candidates, candidates, np.arange(50)), torch.arange(500))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["acd", "humans"])
def test_a_refined_match_of_a_shape_with_itself_is_the_identity(method, tmp_path):
    mesh = csm.load_humans().mesh("s00_p00")
    match = csm.match(mesh, mesh, method, store=Store(tmp_path))
    np.testing.assert_array_equal(match.indices, np.arange(mesh.n_vertices))
