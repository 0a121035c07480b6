from __future__ import annotations

import pickle

import numpy as np
import pytest

from csm.errors import DataError
from csm.matching.maps import VertexMap


def test_a_map_knows_its_direction_and_its_coverage():
    found = VertexMap(np.array([0, 0, 3, -1], dtype=np.int32), 4, "a", "b")
    assert found.indices.dtype == np.int64
    assert found.coverage == 0.5
    assert repr(found) == "VertexMap(a -> b, 4 to 4 vertices)"
    assert VertexMap(np.array([-1, -1]), 4).coverage == 0


def test_a_map_may_be_of_no_vertex():
    assert VertexMap(np.array([], dtype=int), 4).coverage == 0


@pytest.mark.parametrize(
    "indices", [np.array([0, 4]), np.array([-2]), np.array([0.0]), np.zeros((2, 1), dtype=int), np.array(1)]
)
def test_what_is_no_map_is_refused(indices):
    with pytest.raises(DataError, match=r"a -> b: .* integers in 0\.\.3, or -1"):
        VertexMap(indices, 4, "a", "b")


def test_a_map_survives_pickling():
    again = pickle.loads(pickle.dumps(VertexMap(np.array([2, 1]), 3, "a", "b")))
    assert (again.indices.tolist(), again.n_target, again.source) == ([2, 1], 3, "a")


def test_maps_follow_each_other():
    first = VertexMap(np.array([2, -1, 0]), 3, "a", "b")
    second = VertexMap(np.array([1, 0, -1]), 2, "b", "c")
    both = first.compose(second)
    assert (both.indices.tolist(), both.n_target, both.source, both.target) == ([-1, -1, 1], 2, "a", "c")
    turn = np.random.default_rng(0).permutation(9)
    there, back = VertexMap(turn, 9), VertexMap(np.argsort(turn), 9)
    np.testing.assert_array_equal(there.compose(back), np.arange(9))
    with pytest.raises(DataError, match="a -> b ends at 3 vertices, and a -> c begins at 2"):
        first.compose(VertexMap(np.array([0, 1]), 5, "a", "c"))


def test_a_map_is_an_array_of_its_indices():
    found = VertexMap(np.array([2, 1]), 3)
    assert np.asarray(found).tolist() == [2, 1]
    assert np.asarray(found, dtype=np.int32).dtype == np.int32
    assert (len(found), np.arange(3.0)[found].tolist()) == (2, [2.0, 1.0])
    with pytest.raises(ValueError, match="only as a copy"):
        found.__array__(np.int32, copy=False)
