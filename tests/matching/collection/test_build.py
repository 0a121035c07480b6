from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

import csm
from csm.errors import ConfigError
from csm.matching.collection import build
from csm.matching.collection.build import match_collection, medoid, unlikeness
from csm.matching.collection.candidates import Candidates
from csm.matching.collection.members import candidates_of
from tests.matching.collection.copies import QUICK, copies, share_right


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return csm.Store(tmp_path_factory.mktemp("store"))


def test_a_broken_pair_is_mended_by_the_others(store, monkeypatch):
    def broken(task):
        found = candidates_of(task)
        if task.maps is None and task.label_of() == "s1 - s3":  # only a wrong map, and one that looks good
            turned = found.maps[:1] @ np.diag((-1.0) ** np.arange(task.k))
            return Candidates(turned, found.costs[:1] - 0.2)
        return found

    monkeypatch.setattr(build, "candidates_of", broken)
    found = match_collection(copies(5), "wks", refiner=QUICK, store=store, workers=0, progress=False)
    assert [(edge.source, edge.target) for edge in found.mended] == [("s1", "s3")]
    assert found.cycles.alone.max() > 0.5
    assert found.cycles.together.max() < 0.3
    for i, j in permutations(range(5), 2):
        assert share_right(found.vertex_map(i, j).indices, i, j) > 0.95


def test_two_shapes_are_a_collection(store):
    first, second = copies(2)
    shapes = [(first.vertices, first.faces), second]
    found = csm.match_collection(shapes, "wks", refiner=QUICK, store=store, workers=0, progress=False)
    assert found.names == ("shape0", "s1")
    assert len(found.edges) == 1
    assert share_right(found.vertex_map(0, 1).indices, 0, 1, 2) > 0.95


def test_unlike_shapes_are_far_and_like_ones_near():
    rng = np.random.default_rng(0)
    rows = [rng.normal(size=(400, 3)), rng.normal(size=(500, 3)), 2 + rng.normal(size=(300, 3))]
    apart = unlikeness([r.astype(np.float32) for r in rows])
    assert np.allclose(apart, apart.T)
    assert apart[0, 1] < 0.3 < 2 < apart[0, 2]
    with pytest.raises(ConfigError, match="descriptors of 1 and 3 columns"):
        unlikeness([np.zeros((2, 1), np.float32), np.zeros((2, 3), np.float32)])


def test_the_medoid_is_that_of_brute_force():
    rng = np.random.default_rng(1)
    at = rng.random((8, 2))
    pairs = np.array([(i, j) for i in range(8) for j in range(i + 1, 8)])
    lengths = np.linalg.norm(at[pairs[:, 0]] - at[pairs[:, 1]], axis=1)
    assert medoid(pairs, lengths, 8) == np.linalg.norm(at[:, None] - at, axis=-1).sum(1).argmin()
