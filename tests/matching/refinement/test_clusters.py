from __future__ import annotations

import numpy as np
import torch

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
