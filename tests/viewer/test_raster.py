"""The rasteriser against a test of every pixel in every triangle."""

from __future__ import annotations

import numpy as np
import pytest

from csm.viewer.raster import fragments_at, interpolate, visible_faces

WIDTH, HEIGHT = 24, 17


def barycentric(triangle: np.ndarray, x: float, y: float) -> np.ndarray:
    return np.linalg.solve(np.vstack([triangle[:, :2].T, np.ones(3)]), [x, y, 1.0])


def brute_force(triangles: np.ndarray) -> np.ndarray:
    nearest = np.full((HEIGHT, WIDTH), -1)
    depth = np.full((HEIGHT, WIDTH), np.inf)
    for f, triangle in enumerate(triangles):
        for y in range(HEIGHT):
            for x in range(WIDTH):
                weights = barycentric(triangle, x + 0.5, y + 0.5)
                if weights.min() >= 0 and weights @ triangle[:, 2] < depth[y, x]:
                    nearest[y, x], depth[y, x] = f, weights @ triangle[:, 2]
    return nearest


@pytest.mark.parametrize("seed", range(3))
def test_visible_faces_are_those_of_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.uniform([-5, -5, 0], [WIDTH + 5, HEIGHT + 5, 9], (12, 3, 3))
    found = visible_faces(triangles, WIDTH, HEIGHT).reshape(HEIGHT, WIDTH)
    np.testing.assert_array_equal(found, brute_force(triangles))


def test_weights_and_depth_are_those_of_the_pixel_s_centre() -> None:
    triangles = np.random.default_rng(0).uniform([0, 0, 0], [WIDTH, HEIGHT, 9], (4, 3, 3))
    nearest = visible_faces(triangles, WIDTH, HEIGHT)
    covered = np.flatnonzero(nearest >= 0)
    seen = fragments_at(triangles, nearest, covered, WIDTH)
    for i, pixel in enumerate(covered):
        expected = barycentric(triangles[nearest[pixel]], pixel % WIDTH + 0.5, pixel // WIDTH + 0.5)
        np.testing.assert_allclose(seen.weights[i], expected, atol=1e-5)
        assert seen.depth[i] == pytest.approx(expected @ triangles[nearest[pixel], :, 2], abs=1e-4)


def test_a_shared_edge_leaves_no_gap_and_no_double() -> None:
    corners = np.array([[0, 0, 1], [WIDTH, 0, 1], [WIDTH, HEIGHT, 1], [0, HEIGHT, 1]], dtype=float)
    halves = corners[[[0, 1, 2], [0, 2, 3]]]
    both = visible_faces(halves, WIDTH, HEIGHT)
    assert (both >= 0).all()
    alone = [np.count_nonzero(visible_faces(half[None], WIDTH, HEIGHT) >= 0) for half in halves]
    assert sum(alone) == WIDTH * HEIGHT


def test_nothing_in_sight_is_no_error() -> None:
    away = np.array([[[-9, -9, 0], [-8, -9, 0], [-9, -8, 0]]], dtype=float)
    assert (visible_faces(away, WIDTH, HEIGHT) == -1).all()
    edge_on = np.array([[[3, 3, 0], [9, 9, 0], [6, 6, 5]]], dtype=float)
    assert visible_faces(edge_on, WIDTH, HEIGHT).max() <= 0


def test_interpolation_at_a_corner_is_the_corner_s_value() -> None:
    values = np.array([[1, 2], [3, 4], [5, 6], [7, 8]], dtype=np.float32)
    corners = np.array([[3, 1, 0], [2, 1, 0]])
    weights = np.array([[1, 0, 0], [0, 0.5, 0.5]], dtype=np.float32)
    np.testing.assert_allclose(interpolate(weights, values, corners), [[7, 8], [2, 3]])
