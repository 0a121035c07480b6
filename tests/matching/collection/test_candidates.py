from __future__ import annotations

import numpy as np
import pytest

import csm
from csm.matching.collection.candidates import Candidates, joined, judge, search, stacked
from csm.matching.collection.synchronise import apart
from csm.matching.functional import functional_map
from csm.matching.methods import as_method
from csm.matching.refinement.pair import Pair
from tests.matching.collection.copies import QUICK, copies, orders


@pytest.fixture(scope="module")
def pair(tmp_path_factory) -> Pair:
    store = csm.Store(tmp_path_factory.mktemp("store"))
    return Pair.of(*(as_method("wks").describe(mesh, store) for mesh in copies(2)))


@pytest.fixture(scope="module")
def truth(pair) -> np.ndarray:
    here, there = orders(2)
    return functional_map(np.argsort(there)[here], pair.source.spectrum, pair.target.spectrum, 20)


def test_a_search_has_the_true_map_first_and_costs_ascend(pair, truth):
    found = search(pair, QUICK, 20)
    assert found.maps.shape[1:] == (20, 20)
    assert np.allclose(found.maps @ found.maps.transpose(0, 2, 1), np.eye(20), atol=1e-6)
    assert (np.diff(found.costs) >= 0).all()
    assert apart(found.maps[0], truth) < 0.25


def test_a_map_that_is_given_is_refined_and_judged(pair, truth):
    good = judge(truth[None], pair, QUICK, 20)
    bad = judge(np.eye(20)[None], pair, QUICK, 20)
    assert apart(good.maps[0], truth) < 0.25
    assert good.costs[0] < bad.costs[0] + 1e-6


def test_candidates_of_several_edges_are_filled_up_with_none():
    one, two = (Candidates(np.tile(np.eye(2), (n, 1, 1)), np.arange(n) + 1.0) for n in (1, 2))
    both = stacked([one, two])
    assert both.maps.shape == (2, 2, 2, 2)
    assert both.costs.tolist() == [[1, np.inf], [1, 2]]
    assert joined(both, both).costs.tolist() == [[1, np.inf, 1, np.inf], [1, 2, 1, 2]]
