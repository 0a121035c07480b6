"""The camera: proper rotations, up that stays up, framing that fits."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, body_axes, guess_up, project, rotation, turned_alike
from tests.shapes import blob, cylinder, sphere
from tests.shapes import rotation as turn


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("azimuth", [0, 37, 200])
def test_views_are_proper_rotations_that_keep_up(up: str, azimuth: float) -> None:
    axes = rotation(sphere(1), View(up=up, azimuth=azimuth, elevation=15))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    k = "xyz".index(up)
    assert axes[0, k] == pytest.approx(0, abs=1e-12)
    assert axes[1, k] == pytest.approx(np.cos(np.radians(15)))


def test_longest_axis_is_up() -> None:
    assert guess_up(cylinder()) == "z"


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_body_axes_are_the_viewer_s_at_rest(up: str) -> None:
    axes = body_axes(sphere(1), up)
    np.testing.assert_allclose(axes, rotation(sphere(1), View(up=up, elevation=0)), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_a_mesh_that_lies_or_looks_elsewhere_is_seen_as_its_partner_is() -> None:
    reference = blob(3)
    order = np.random.default_rng(0).permutation(reference.n_vertices)
    mesh = Mesh(3 * reference.vertices[order] @ turn(1).T + 7, np.argsort(order)[reference.faces])
    axes = body_axes(reference, "y")
    order[5] = -1
    found = turned_alike(mesh, order, reference, "y")
    assert np.linalg.det(found) == pytest.approx(1)
    seen, wanted = (mesh.vertices - 7) @ found.T / 3, reference.vertices @ axes.T
    np.testing.assert_allclose(seen[order >= 0], wanted[order[order >= 0]], atol=0.02)


@pytest.mark.parametrize("partners", ["none", "two", "one for all", "drawn"])
def test_without_a_map_to_believe_a_mesh_stands_by_itself(partners: str) -> None:
    mesh = cylinder()
    indices = np.full(mesh.n_vertices, -1 if partners in ("none", "two") else 0)
    if partners == "two":
        indices[:2] = [3, 4]
    if partners == "drawn":
        indices = np.random.default_rng(0).permutation(mesh.n_vertices)
    np.testing.assert_array_equal(turned_alike(mesh, indices, mesh, "x"), body_axes(mesh, "x"))


def test_the_whole_shape_fits_with_a_margin_and_is_centred() -> None:
    points = project(blob(3), View(azimuth=20), 100, 60)
    low, high = points.min(axis=0), points.max(axis=0)
    np.testing.assert_allclose(0.5 * (low + high)[:2], [50, 30])
    assert (low[:2] > 0).all()
    assert high[0] < 100
    assert high[1] < 60
    assert max((high - low)[0] / 100, (high - low)[1] / 60) == pytest.approx(0.94)


def test_a_given_height_makes_lengths_comparable_between_shapes() -> None:
    small, large = (project(sphere(2, radius), View(height=4.0), 80, 80) for radius in (0.5, 1.0))
    assert np.ptp(large[:, 0]) == pytest.approx(2 * np.ptp(small[:, 0]))
    assert np.ptp(large[:, 0]) == pytest.approx(80 / 4 * np.ptp(sphere(2).vertices[:, 0]), rel=0.02)


def test_depth_grows_away_from_the_viewer_and_down_is_down() -> None:
    mesh = Mesh([[0, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2]])
    points = project(mesh, View(elevation=0), 10, 10)
    assert points[1, 1] < points[0, 1]  # higher in the data, nearer to the first row
    assert points[2, 2] < points[0, 2]  # further along +z, nearer to the viewer


def test_vertices_without_a_face_do_not_change_the_framing() -> None:
    mesh = sphere(2)
    more = Mesh(np.concatenate([mesh.vertices, [[99, 99, 99]]]), mesh.faces)
    np.testing.assert_array_equal(project(more, View(), 50, 50)[:-1], project(mesh, View(), 50, 50))


def test_unusable_views_are_refused() -> None:
    with pytest.raises(ConfigError, match="up"):
        View(up="w")
    with pytest.raises(ConfigError, match="height"):
        View(height=0.0)
