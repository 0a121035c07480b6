import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from csm.errors import DataError
from csm.mesh.correspondence import Direction, PointMap, ground_truth

TO_SHAPE, TO_TEMPLATE = Direction.TEMPLATE_TO_SHAPE, Direction.SHAPE_TO_TEMPLATE


@st.composite
def point_maps(draw, direction=TO_SHAPE, n_from=None, n_to=None):
    n_to = draw(st.integers(1, 20)) if n_to is None else n_to
    size = draw(st.integers(1, 20)) if n_from is None else n_from
    values = draw(st.lists(st.integers(-1, n_to - 1), min_size=size, max_size=size))
    return PointMap(np.array(values), direction, n_to)


def test_identity_onto_the_first_vertices():
    found = PointMap.identity(3, 5)
    assert found.indices.tolist() == [0, 1, 2]
    assert (found.direction, found.n_from, found.n_to, len(found.known)) == (TO_SHAPE, 3, 5, 3)
    with pytest.raises(DataError, match="point 3 goes to 3"):
        PointMap.identity(5, 3)


@pytest.mark.parametrize("bad", [[0, 3], [-2, 0]])
def test_indices_out_of_range_are_refused(bad):
    with pytest.raises(DataError, match=r"a\.vts: point"):
        PointMap(np.array(bad), TO_SHAPE, 3, "a.vts")


@pytest.mark.parametrize("bad", [np.array([0.0]), np.array([[0]]), np.array([True])])
def test_only_vectors_of_integers(bad):
    with pytest.raises(DataError, match="wanted a vector of integers"):
        PointMap(bad, TO_SHAPE, 3)


def test_arrays_are_copied_and_frozen():
    given_indices = np.array([0, 1])
    found = PointMap(given_indices, TO_SHAPE, 2)
    given_indices[0] = 1
    assert found.indices.tolist() == [0, 1]
    with pytest.raises(ValueError, match="read-only"):
        found.indices[0] = 1


@settings(deadline=None)
@given(point_maps(TO_TEMPLATE))
def test_inversion_takes_the_first_vertex_of_each_template_point(backward):
    forward = backward.as_template_to_shape()
    assert forward.direction is TO_SHAPE
    assert (forward.n_from, forward.n_to) == (backward.n_to, backward.n_from)
    assert len(forward.notes) == 1
    for point in range(backward.n_to):
        vertices = np.flatnonzero(backward.indices == point)
        assert forward.indices[point] == (vertices[0] if len(vertices) else -1)


@settings(deadline=None)
@given(point_maps(TO_SHAPE))
def test_a_map_in_the_right_direction_stays(found):
    assert found.as_template_to_shape() is found
    assert found.as_template_to_shape(found.n_from) is found


def test_inversion_counts_what_it_decided():
    note = PointMap(np.array([2, 2, 2, 0, -1]), TO_TEMPLATE, 4).as_template_to_shape().notes[0]
    assert "2 vertices share" in note
    assert "2 template points have no vertex" in note


def test_a_map_of_another_template_is_refused():
    with pytest.raises(DataError, match="template with 3 points, wanted 6890"):
        PointMap(np.array([0, 1, 2]), TO_SHAPE, 3, "x.vts").as_template_to_shape(6890)
    with pytest.raises(DataError, match="template with 5 points, wanted 3"):
        PointMap(np.array([0, 1, 2]), TO_TEMPLATE, 5).as_template_to_shape(3)


@settings(deadline=None)
@given(st.integers(1, 15).flatmap(lambda n: st.tuples(point_maps(n_from=n), point_maps(n_from=n))))
def test_ground_truth_is_the_join_over_template_points(maps):
    a, b = maps
    expected = [(i, j) for i, j in zip(a.indices.tolist(), b.indices.tolist(), strict=True) if i >= 0 and j >= 0]
    if not expected:
        with pytest.raises(DataError, match="no template point in common"):
            ground_truth(a, b)
        return
    found = ground_truth(a, b)
    assert list(zip(found.source.tolist(), found.target.tolist(), strict=True)) == expected
    assert len(found) == len(expected)


def test_maps_of_different_templates_have_no_ground_truth():
    with pytest.raises(DataError, match="templates with 3 and 4 points"):
        ground_truth(PointMap.identity(3), PointMap.identity(4))
