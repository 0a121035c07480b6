"""Colours: smooth over the surface, different on the left and on the right, and transferred along a map."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import colormaps
from scipy.spatial import cKDTree

from csm.data.humans import load_humans
from csm.errors import ConfigError
from csm.viewer.colors import UNMATCHED, position_colors, pull_colors, ramp, scalar_colors
from csm.viewer.shade import linear
from tests.shapes import blob, sphere

# Machado, Oliveira, Fernandes, "A physiologically-based model for simulation of color vision deficiency", IEEE TVCG
# 15(6), 2009: linear RGB as people without one kind of cones see it.
EYES = {
    "usual": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
# IEC 61966-2-1: linear sRGB to XYZ, as fractions of the white D65.
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_XYZ = _XYZ / _XYZ.sum(axis=1, keepdims=True)

RED, GREEN, BLUE = [255, 0, 0], [0, 255, 0], [0, 0, 255]


def test_neighbours_look_alike_and_opposite_points_differ() -> None:
    mesh = sphere(4)
    colors = position_colors(mesh, up="z").astype(int)
    edges = mesh.faces[:, [0, 1]]
    assert np.abs(colors[edges[:, 0]] - colors[edges[:, 1]]).max() < 64
    for axis in range(3):
        low, high = mesh.vertices[:, axis].argmin(), mesh.vertices[:, axis].argmax()
        assert np.abs(colors[low] - colors[high]).max() > 30


def test_left_is_orange_and_right_is_blue_at_every_height() -> None:
    mesh = blob(4)
    colors = position_colors(mesh, up="y").astype(int)
    left, right = mesh.vertices[:, 0] < -0.5, mesh.vertices[:, 0] > 0.5
    blueness = colors[:, 2] - colors[:, 0]
    assert blueness[right].min() > blueness[left].max()


@pytest.mark.parametrize("eyes", EYES)
def test_mirrored_points_of_a_body_differ_for_colour_blind_eyes(eyes: str) -> None:
    body = load_humans().mesh("s00_p00")
    seen = _lab(position_colors(body), EYES[eyes])
    mirrored = body.vertices * [-1, 1, 1] + [body.vertices[:, 0].min() + body.vertices[:, 0].max(), 0, 0]
    partner = cKDTree(body.vertices).query(mirrored)[1]
    assert np.median(np.linalg.norm(seen - seen[partner], axis=1)) > 50
    i, j = body.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    assert np.percentile(np.linalg.norm(seen[i] - seen[j], axis=1), 99) < 8, "neighbours look alike"


@pytest.mark.parametrize("eyes", EYES)
def test_hands_feet_and_head_differ_for_colour_blind_eyes(eyes: str) -> None:
    body = load_humans().mesh("s00_p00")
    seen, (x, _, z) = _lab(position_colors(body), EYES[eyes]), body.vertices.T
    ends = {"hands": (x.argmin(), x.argmax()), "head": (z.argmax(),)}
    ends["feet"] = tuple(np.flatnonzero(side)[z[side].argmin()] for side in (x < x.mean(), x > x.mean()))
    tips = seen[[vertex for group in ends.values() for vertex in group]]
    apart = np.linalg.norm(tips[:, None] - tips, axis=2)
    assert apart[~np.eye(len(tips), dtype=bool)].min() > 12


def _lab(colors: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* (D65) of what such eyes see of sRGB colours; its Euclidean distance is Delta E (1976)."""
    xyz = np.clip(linear(colors / 255) @ eyes.T, 0, 1) @ _XYZ.T
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


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


@pytest.mark.parametrize(
    ("name", "colormap"), [("confidence", "cividis"), ("errors", "YlOrRd"), ("distance", "YlGnBu_r")]
)
def test_ramps_of_pages_are_the_colour_maps_of_figures(name: str, colormap: str) -> None:
    shades = ramp(name, 128)
    expected = colormaps[colormap](np.linspace(0, 1, 128), bytes=True)[:, :3]
    assert np.abs(shades.astype(int) - expected).max() <= 8
    np.testing.assert_array_equal(ramp(name, 2), shades[[0, -1]])


def test_pull_takes_the_colour_of_the_image() -> None:
    pulled = pull_colors([RED, GREEN, BLUE], np.array([2, 2, -1, 0]))
    np.testing.assert_array_equal(pulled, [BLUE, BLUE, UNMATCHED, RED])


@pytest.mark.parametrize("indices", [np.array([0, 3]), np.array([-2, 0]), np.array([0.5, 1.0]), np.array([[0, 1]])])
def test_maps_that_leave_the_shape_are_refused(indices: np.ndarray) -> None:
    with pytest.raises(ConfigError, match="map"):
        pull_colors([RED, GREEN, BLUE], indices)
