from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from csm.errors import ConfigError, DataError
from csm.matching import _triangles
from csm.matching.barycentric import BarycentricMap, nearest_on_faces
from csm.matching.maps import VertexMap
from tests.shapes import blob, plane, sphere, torus

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def embedded(mesh, width: int, seed: int = 0) -> np.ndarray:
    """A smooth but bent embedding of a mesh in many dimensions."""
    waves = np.random.default_rng(seed).normal(size=(3, width))
    return np.sin(mesh.vertices @ waves)


def by_programming(query: np.ndarray, corners: np.ndarray) -> float:
    """Distance from a point to a triangle as a problem of least squares with shares that are not negative."""
    heavy = 1e4
    rows = np.vstack([corners.T, np.full(3, heavy)])
    shares, _ = nnls(rows, np.append(query, heavy))
    return float(np.linalg.norm(shares / shares.sum() @ corners - query))


@pytest.mark.parametrize("width", [3, 6, 7, 40])
@pytest.mark.parametrize("noise", [0.02, 1.0])
def test_every_query_against_every_face_by_other_means_is_no_nearer(width, noise):
    mesh, rng = blob(1), np.random.default_rng(1)
    points = embedded(mesh, width)
    queries = points[rng.integers(0, len(points), 25)] + noise * rng.normal(size=(25, width)) / np.sqrt(width)
    found = nearest_on_faces(queries, points, mesh.faces)
    slow = [[by_programming(q, points[face]) for face in mesh.faces] for q in queries]
    np.testing.assert_allclose(np.linalg.norm(found.pull(points) - queries, axis=1), np.min(slow, axis=1), atol=1e-6)
    assert (np.linalg.norm(found.pull(points) - queries, axis=1) <= np.min(slow, axis=1) + 1e-9).all()


@pytest.mark.parametrize("width", [3, 30])
def test_points_of_the_surface_are_found_where_they_are(width):
    mesh, rng = torus(n=20, m=10), np.random.default_rng(2)
    points = embedded(mesh, width)
    at_vertices = nearest_on_faces(points, points, mesh.faces)
    np.testing.assert_array_equal(at_vertices.vertex_map(), np.arange(mesh.n_vertices))
    np.testing.assert_allclose(at_vertices.weights.max(1), 1.0, atol=1e-9)
    middles = points[mesh.faces[:, :2]].mean(1)
    np.testing.assert_allclose(nearest_on_faces(middles, points, mesh.faces).pull(points), middles, atol=1e-7)
    shares = rng.dirichlet(np.ones(3), mesh.n_faces)
    within = nearest_on_faces((shares[:, :, None] * points[mesh.faces]).sum(1), points, mesh.faces)
    np.testing.assert_array_equal(within.faces, np.arange(mesh.n_faces))
    np.testing.assert_allclose(within.weights, shares, atol=1e-7)


@pytest.mark.parametrize("width", [3, 30])
def test_small_blocks_and_a_search_that_is_split_change_nothing(width, monkeypatch):
    mesh = blob(2)
    points = embedded(mesh, width)
    queries = embedded(mesh, width, seed=1)
    found = nearest_on_faces(queries, points, mesh.faces)
    monkeypatch.setattr(_triangles, "_BLOCK", 1000)
    monkeypatch.setattr(_triangles, "_PAIRS", 50)
    again = nearest_on_faces(queries, points, mesh.faces)
    np.testing.assert_array_equal(again.faces, found.faces)
    np.testing.assert_allclose(again.weights, found.weights, atol=1e-12)


def test_faces_of_very_different_sizes_are_found_by_trees_as_by_products(monkeypatch):
    mesh, rng = blob(2), np.random.default_rng(4)
    sizes = 10.0 ** rng.integers(-3, 4, 60)
    triangles = rng.normal(size=(60, 3, 3)) * sizes[:, None, None] + rng.normal(size=(60, 1, 3)) * sizes[:, None, None]
    points = np.vstack([mesh.vertices, triangles.reshape(-1, 3), np.zeros((1, 3))])
    faces = np.vstack([mesh.faces, np.arange(180).reshape(-1, 3) + 162, [[342, 342, 342]]])
    queries = np.vstack([rng.normal(size=(150, 3)) * 10.0 ** rng.integers(-3, 4, (150, 1)), np.zeros((1, 3))])
    found = nearest_on_faces(queries, points, faces)
    monkeypatch.setattr(_triangles, "_FEW_DIMENSIONS", 0)
    again = nearest_on_faces(queries, points, faces)
    np.testing.assert_allclose(
        np.linalg.norm(found.pull(points) - queries, axis=1),
        np.linalg.norm(again.pull(points) - queries, axis=1),
        rtol=1e-9,
        atol=1e-7,
    )


def test_faces_without_area_are_as_good_as_their_sides():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0], [3, 0, 0], [9, 9, 9]])
    found = nearest_on_faces([[2.0, 1, 0], [-1, 0, 0], [3, 2, 0]], line, np.array([[0, 1, 2], [2, 3, 3]]))
    np.testing.assert_allclose(found.pull(line), [[2, 0, 0], [0, 0, 0], [3, 0, 0]], atol=1e-12)
    assert found.faces[2] == 0


@pytest.mark.parametrize("few", [0, 6])
def test_vertices_in_no_face_are_never_reached_wherever_they_are(few, monkeypatch):
    monkeypatch.setattr(_triangles, "_FEW_DIMENSIONS", few)
    lone = np.vstack([SQUARE, [[0.5, 5.0], [np.nan, np.inf]]])
    found = nearest_on_faces([[0.5, 5.0]], lone, HALVES)
    np.testing.assert_allclose(found.pull(lone), [[0.5, 1.0]])


def test_a_map_pulls_linear_functions_as_they_are_and_says_the_same_as_its_matrix():
    mesh, other = plane(), plane(seed=3)
    found = nearest_on_faces(other.vertices, mesh.vertices, mesh.faces, source="a", target="b")
    linear = mesh.vertices @ np.array([2.0, -1.0, 0.0]) + 5
    np.testing.assert_allclose(found.pull(linear), other.vertices @ np.array([2.0, -1.0, 0.0]) + 5, atol=1e-9)
    np.testing.assert_allclose(found.matrix() @ linear, found.pull(linear))
    np.testing.assert_allclose(found.points(mesh), other.vertices, atol=1e-9)
    assert found.matrix().shape == (225, 225)
    assert repr(found) == "BarycentricMap(a -> b, 225 vertices to 392 faces)"
    assert found.vertex_map().source == "a"


def test_a_map_to_vertices_is_one_to_corners():
    mesh = sphere(1)
    plain = VertexMap(np.array([3, -1, 0, 41]), 42, "a", "b")
    found = BarycentricMap.of_vertices(plain, mesh.faces)
    np.testing.assert_array_equal(found.vertex_map(), plain)
    np.testing.assert_array_equal(found.points(mesh)[[0, 2, 3]], mesh.vertices[[3, 0, 41]])
    assert np.isnan(found.points(mesh)[1]).all()
    assert found.matrix()[1].nnz == 0
    lone = BarycentricMap.of_vertices(VertexMap(np.array([4, 1]), 5), HALVES)
    assert lone.faces.tolist() == [-1, 0]


def test_corners_without_weight_take_no_part():
    values = np.array([1.0, np.nan, np.inf, 3.0])
    found = BarycentricMap(np.array([0, 1]), np.array([[1.0, 0, 0], [0.5, 0, 0.5]]), HALVES, 4)
    assert found.pull(values).tolist() == [1.0, 2.0]
    assert found.pull(np.ones((4, 2, 2), dtype=np.float32)).dtype == np.float32
    assert found.vertex_map().indices.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("faces", "weights", "said"),
    [
        ([0], [[0.5, 0.2, 0.2]], "weights of vertex 0 are .* sum to 1"),
        ([0], [[1.5, -0.5, 0.0]], "shares from 0 to 1"),
        ([0], [[np.nan, 0, 1]], "shares from 0 to 1"),
        ([2], [[1, 0, 0]], r"integers in 0\.\.1, or -1"),
        ([0.0], [[1, 0, 0]], "integers"),
        ([0, 1], [[1, 0, 0]], r"weights \(1, 3\), wanted \(2, 3\)"),
    ],
)
def test_what_is_no_map_is_refused(faces, weights, said):
    with pytest.raises(DataError, match=said):
        BarycentricMap(np.array(faces), np.array(weights), HALVES, 4, "a", "b")


def test_values_and_points_that_do_not_fit_are_refused():
    found = BarycentricMap(np.array([0]), np.array([[1.0, 0, 0]]), HALVES, 4, "a", "b")
    with pytest.raises(DataError, match="one row for each of the 4 vertices of b"):
        found.pull(np.zeros(3))
    with pytest.raises(ConfigError, match=r"\(1, 3\) against \(4, 2\)"):
        nearest_on_faces(np.zeros((1, 3)), SQUARE, HALVES)
    with pytest.raises(ConfigError, match="M > 0"):
        nearest_on_faces(SQUARE, SQUARE, np.zeros((0, 3), dtype=int))
    with pytest.raises(ConfigError, match="not finite"):
        nearest_on_faces(np.full((1, 2), np.nan), SQUARE, HALVES)
