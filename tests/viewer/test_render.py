"""Pictures against geometry that is known: areas, depth order, plain colours."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View
from csm.viewer.render import as_colors, render
from tests.shapes import sphere

FLAT = View(elevation=0)
RED, BLUE = (255, 0, 0), (0, 0, 255)


def sheets(*heights: float) -> Mesh:
    """Squares of side 1 facing +z, one per given z, four vertices each."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    vertices = np.concatenate([square + np.array([0, 0, z]) for z in heights])
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(len(heights))])
    return Mesh(vertices, faces, "sheets")


def test_silhouette_of_a_sphere_is_a_disc() -> None:
    picture = render(sphere(4), size=(120, 120), view=View(height=4.0), background="transparent")
    covered = picture[..., 3].astype(float) / 255
    radius = 120 / 4.0
    assert covered.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
    y, x = np.indices(covered.shape) + 0.5
    assert (covered * x).sum() / covered.sum() == pytest.approx(60, abs=0.05)
    assert (covered * y).sum() / covered.sum() == pytest.approx(60, abs=0.05)


@pytest.mark.parametrize("order", [(0.0, 1.0), (1.0, 0.0)])
def test_nearest_surface_wins_whatever_the_order_of_faces(order: tuple[float, float]) -> None:
    colors = np.repeat([RED if z == 1 else BLUE for z in order], 4, axis=0).astype(np.uint8)
    front = render(sheets(*order), colors, size=(40, 40), view=FLAT, lighting=False)
    assert (front[20, 20] == RED).all()
    back = render(sheets(*order), colors, size=(40, 40), view=View(azimuth=180, elevation=0), lighting=False)
    assert (back[20, 20] == BLUE).all()


def test_crossing_surfaces_are_split_where_they_cross() -> None:
    tilted = sheets(0.0).vertices @ np.array([[1, 0, 1], [0, 1, 0], [0, 0, 1]]) - [0, 0, 0.5]
    mesh = Mesh(np.concatenate([sheets(0.0).vertices, tilted]), sheets(0.0, 0.0).faces)
    colors = np.repeat([BLUE, RED], 4, axis=0).astype(np.uint8)
    row = render(mesh, colors, size=(100, 100), view=FLAT, lighting=False, supersample=1)[50]
    is_red = np.flatnonzero((row == RED).all(axis=1))
    assert is_red.min() == pytest.approx(50, abs=1)  # z = x - 0.5 lies in front of z = 0 on the right half
    assert is_red.max() == pytest.approx(97, abs=1)


def test_every_pixel_of_a_square_is_covered_once_and_shows_its_colour() -> None:
    picture = render(sheets(0.0), (10, 200, 30), size=(60, 60), view=View(elevation=0, height=1.0), lighting=False)
    assert (picture == (10, 200, 30)).all()


def test_colours_are_interpolated_linearly_in_light() -> None:
    colors = np.array([[0, 0, 0], [1, 1, 1], [1, 1, 1], [0, 0, 0]], dtype=float)
    picture = render(sheets(0.0), colors, size=(101, 101), view=View(elevation=0, height=1.0), lighting=False)
    assert picture[50, 50, 0] == pytest.approx(255 * (1.055 * 0.5 ** (1 / 2.4) - 0.055), abs=1)


def test_up_and_right_of_the_data_are_up_and_right_of_the_picture() -> None:
    mesh = sheets(0.0)
    colors = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [255, 255, 255]], dtype=np.uint8)  # white at low x, high y
    gray = render(mesh, colors, size=(50, 50), view=View(elevation=0, height=1.0), lighting=False)[..., 0]
    assert np.unravel_index(gray.argmax(), gray.shape) == (0, 0)


def test_white_background_is_white_and_transparent_is_clear() -> None:
    white = render(sphere(2), size=(40, 40))
    clear = render(sphere(2), size=(40, 40), background="transparent")
    assert white.shape == (40, 40, 3)
    assert clear.shape == (40, 40, 4)
    assert (white[0, 0] == 255).all()
    assert clear[0, 0, 3] == 0
    assert clear[20, 20, 3] == 255
    np.testing.assert_array_equal(white[clear[..., 3] == 255], clear[clear[..., 3] == 255][:, :3])


def test_same_bytes_every_time() -> None:
    np.testing.assert_array_equal(render(sphere(3), size=(50, 60)), render(sphere(3), size=(50, 60)))


def test_light_comes_from_above_and_the_inside_is_lit() -> None:
    picture = render(sphere(4), size=(80, 80), view=FLAT)
    assert picture[15, 40].sum() > picture[65, 40].sum() + 60
    inside = render(Mesh(sheets(0.0).vertices, sheets(0.0).faces[:, ::-1]), size=(20, 20), view=FLAT)
    np.testing.assert_array_equal(inside, render(sheets(0.0), size=(20, 20), view=FLAT))


def test_shape_outside_the_picture_and_flat_shapes_are_drawn_without_failing() -> None:
    far = Mesh(np.concatenate([sheets(0.0).vertices, [[50, 50, 50]]]), sheets(0.0).faces)  # the last vertex has no face
    assert (render(far, RED, size=(20, 20), view=FLAT, lighting=False)[10, 10] == RED).all()
    edge_on = render(sheets(0.0), size=(20, 20), view=View(azimuth=90, elevation=0))
    assert np.isfinite(edge_on).all()


def test_colours_are_taken_as_bytes_or_fractions() -> None:
    np.testing.assert_array_equal(as_colors([255, 0, 51], 2), [[1, 0, 0.2]] * 2)
    np.testing.assert_array_equal(as_colors(np.eye(3), 3), np.eye(3))


@pytest.mark.parametrize("colors", [np.zeros((4, 3)), np.full((162, 3), 2.0), np.full(3, np.nan), [300, 0, 0], "red"])
def test_unusable_colours_are_refused(colors: object) -> None:
    with pytest.raises(ConfigError, match="colours"):
        render(sphere(2), colors)


def test_undrawable_meshes_and_options_are_refused() -> None:
    with pytest.raises(MeshError, match="no faces"):
        render(Mesh(np.zeros((3, 3)), np.zeros((0, 3))))
    with pytest.raises(MeshError, match="vertex 1 is not finite"):
        render(Mesh([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    with pytest.raises(ConfigError, match="background"):
        render(sphere(1), background="black")
    with pytest.raises(ConfigError, match="1 or more"):
        render(sphere(1), size=(0, 10))
