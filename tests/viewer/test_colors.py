"""Colours: smooth over the surface, different on the left and on the right, and transferred along a map."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import colormaps

from csm.errors import ConfigError
from csm.viewer.colors import UNMATCHED, position_colors, pull_colors, scalar_colors
from tests.shapes import blob, sphere

RED, GREEN, BLUE = [255, 0, 0], [0, 255, 0], [0, 0, 255]


def test_neighbours_look_alike_and_opposite_points_differ() -> None:
    mesh = sphere(4)
    colors = position_colors(mesh, up="z").astype(int)
    edges = mesh.faces[:, [0, 1]]
    assert np.abs(colors[edges[:, 0]] - colors[edges[:, 1]]).max() < 64
    for axis in range(3):
        low, high = mesh.vertices[:, axis].argmin(), mesh.vertices[:, axis].argmax()
        assert np.abs(colors[low] - colors[high]).max() > 30


def test_left_and_right_differ_in_hue_at_every_height() -> None:
    mesh = blob(4)
    colors = position_colors(mesh, up="y").astype(int)
    left, right = mesh.vertices[:, 0] > 0.5, mesh.vertices[:, 0] < -0.5
    redness = colors[:, 0] - colors[:, 1]
    assert redness[right].min() > redness[left].max()


def test_position_colours_do_not_depend_on_scale_place_or_vertex_order() -> None:
    mesh = blob(3)
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    moved = type(mesh)(3 * mesh.vertices[order] + 1, np.argsort(order)[mesh.faces])
    difference = position_colors(moved).astype(int) - position_colors(mesh)[order]
    assert np.abs(difference).max() <= 1


def test_scalar_colours_follow_the_colour_map_and_grey_the_unknown() -> None:
    colors = scalar_colors([0.0, 0.5, 1.0, 7.0, -1.0, np.nan], low=0.0, high=1.0)
    expected = colormaps["viridis"]([0.0, 0.5, 1.0, 1.0, 0.0], bytes=True)[:, :3]
    np.testing.assert_array_equal(colors[:5], expected)
    np.testing.assert_array_equal(colors[5], UNMATCHED)


def test_scalar_colours_span_the_finite_values_by_default() -> None:
    np.testing.assert_array_equal(scalar_colors([3.0, np.nan, 9.0]), scalar_colors([0.0, np.nan, 1.0], 0.0, 1.0))
    assert (scalar_colors([np.nan, np.inf]) == UNMATCHED).all()
    assert len(np.unique(scalar_colors([2.0, 2.0]), axis=0)) == 1
    with pytest.raises(ConfigError, match="no-such-map"):
        scalar_colors([0.0], colormap="no-such-map")


def test_pull_takes_the_colour_of_the_image() -> None:
    pulled = pull_colors([RED, GREEN, BLUE], np.array([2, 2, -1, 0]))
    np.testing.assert_array_equal(pulled, [BLUE, BLUE, UNMATCHED, RED])


@pytest.mark.parametrize("indices", [np.array([0, 3]), np.array([-2, 0]), np.array([0.5, 1.0]), np.array([[0, 1]])])
def test_maps_that_leave_the_shape_are_refused(indices: np.ndarray) -> None:
    with pytest.raises(ConfigError, match="map"):
        pull_colors([RED, GREEN, BLUE], indices)
