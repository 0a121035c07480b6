from __future__ import annotations

import numpy as np
import pytest

import csm
from csm.matching.collection import members
from csm.matching.collection.members import EdgeTask, Member, both_maps, candidates_of, finest
from csm.matching.functional import functional_map
from csm.matching.methods import as_method
from csm.matching.refinement.multistart import Multistart
from tests.matching.collection.copies import copies, orders, share_right


@pytest.fixture
def two(tmp_path) -> list[Member]:
    store = csm.Store(tmp_path)
    return [Member(m, as_method("wks").describe(m, store).features.numpy(), store.root) for m in copies(2)]


def test_a_few_embedded_shapes_are_kept_and_older_ones_forgotten(two, monkeypatch):
    monkeypatch.setattr(members, "_KEPT", 1)
    first = two[0].described().embedded
    assert two[0].described().embedded is first
    two[1].described()
    assert two[0].described().embedded is not first
    assert len(members._recent) == 1


def test_the_true_functional_map_gives_the_true_vertex_maps_there_and_back(two):
    here, there = orders(2)
    pair = EdgeTask(*two, Multistart(), 20).pair()
    matrix = functional_map(np.argsort(there)[here], pair.source.spectrum, pair.target.spectrum, 20)
    refiner = Multistart(schedule=(20, 40, 60))
    task = EdgeTask(*two, refiner, 20, matrix[None])
    forward, backward = both_maps(task)
    assert task.label_of() == "s0 - s1"
    assert share_right(forward, 0, 1, 2) > 0.97
    assert share_right(backward, 1, 0, 2) > 0.97
    found = finest(matrix, pair, refiner.climb)
    assert (found.forward.vertex_map.source, found.forward.vertex_map.target) == ("s0", "s1")
    assert np.array_equal(found.forward.vertex_map.indices, forward)


def test_a_task_with_maps_judges_them_and_one_without_searches(two):
    refiner = Multistart(signs=2, finalists=2)
    judged = candidates_of(EdgeTask(*two, refiner, 20, np.eye(20)[None]))
    assert len(judged.costs) == 1
    assert 1 <= len(candidates_of(EdgeTask(*two, refiner, 20)).costs) <= 2
