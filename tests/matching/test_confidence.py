import numpy as np
import pytest

from csm.matching import VertexMap
from csm.matching.confidence import NEAR, Confidence, there_and_back
from tests.shapes import sphere


def test_a_map_and_its_inverse_return_everything():
    ball = sphere(2)
    there = np.random.default_rng(0).permutation(ball.n_vertices)
    found = there_and_back(VertexMap(there, 162), VertexMap(np.argsort(there), 162), ball)
    assert not found.distance.any()
    assert (found.values == 1).all()
    assert found.returned == 1
    assert "WARNING" not in found.verdict


def test_distances_are_in_units_of_the_root_of_the_area_and_inf_without_a_match():
    ball = sphere(2, radius=3.0)
    there = np.where(np.arange(162) == 5, -1, 0)
    found = there_and_back(VertexMap(there, 162), VertexMap(np.full(162, 7), 162), ball)
    wanted = np.linalg.norm(ball.vertices - ball.vertices[7], axis=1) / np.sqrt(ball.area)
    np.testing.assert_allclose(np.delete(found.distance, 5), np.delete(wanted, 5))
    assert np.isinf(found.distance[5])
    assert found.values[5] == 0


@pytest.mark.parametrize(("share", "said"), [(0.95, "consistent"), (0.7, "limbs"), (0.3, "WARNING"), (0.0, "WARNING")])
def test_the_verdict_gets_worse_as_fewer_return(share, said):
    distance = np.where(np.arange(100) < 100 * share, 0.5 * NEAR, 3 * NEAR)
    assert said in Confidence(distance).verdict
    assert Confidence(distance).returned == pytest.approx(share)


def test_a_map_without_any_match_is_not_believed():
    assert Confidence(np.full(3, np.inf)).returned == 0
