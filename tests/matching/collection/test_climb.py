from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.linalg import expm

import csm
from csm.matching.collection.climb import consistent, finer
from csm.matching.collection.synchronise import apart, composed
from csm.matching.functional import functional_map
from csm.matching.functional import orthogonal as polar
from csm.matching.methods import as_method
from csm.matching.refinement.pair import Pair
from tests.matching.collection.copies import QUICK, copies, orders


@pytest.fixture(scope="module")
def pair(tmp_path_factory) -> Pair:
    store = csm.Store(tmp_path_factory.mktemp("store"))
    return Pair.of(*(as_method("wks").describe(mesh, store) for mesh in copies(2)))


def test_a_true_map_becomes_the_true_map_of_the_next_size(pair):
    here, there = orders(2)
    small, large = (
        functional_map(np.argsort(there)[here], pair.source.spectrum, pair.target.spectrum, k) for k in (20, 40)
    )
    found = finer(small, pair, QUICK.climb, 40)
    assert np.allclose(found @ found.T, np.eye(40), atol=1e-6)
    assert apart(found, large) < 0.25
    assert np.allclose(finer(small.T, pair.reversed, QUICK.climb, 40), found.T, atol=1e-5)


def test_noise_is_averaged_and_a_wrong_map_counts_little():
    n, k = 8, 5
    pairs, rng = np.array(list(combinations(range(n), 2))), np.random.default_rng(0)
    truth = composed(polar(rng.normal(size=(n, k, k))), pairs)
    noise = 0.05 * rng.normal(size=truth.shape)
    given = np.stack([one @ expm(turn - turn.T) for one, turn in zip(truth, noise, strict=True)])
    given[4] = given[4] @ np.diag([1.0, -1, -1, 1, 1])
    found = composed(consistent(given, pairs, 0.25, n), pairs)
    others = np.arange(len(pairs)) != 4
    assert apart(found, truth)[others].mean() < 0.8 * apart(given, truth)[others].mean()
    assert apart(found, truth)[4] < 0.1
