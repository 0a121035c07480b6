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
