"""Points on surfaces: nearest points against brute force, walking, nearest marks."""

from __future__ import annotations

import numpy as np
import trimesh

from csm.mesh.surface import Surface, SurfacePoints, nearest_on_triangles
from tests.shapes import blob, sphere


def test_nearest_on_triangles_agrees_with_trimesh() -> None:
    rng = np.random.default_rng(0)
    points, triangles = rng.normal(size=(500, 3)), rng.normal(size=(500, 3, 3))
    weights, squared = nearest_on_triangles(points, triangles)
    expected = trimesh.triangles.closest_point(triangles, points)
    np.testing.assert_allclose(np.einsum("pk,pkc->pc", weights, triangles), expected, atol=1e-9)
    np.testing.assert_allclose(np.sqrt(squared), np.linalg.norm(points - expected, axis=1), atol=1e-9)
    assert weights.min() >= 0


def test_a_triangle_without_area_is_its_edges() -> None:
    triangles = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 1, 1]] * 3], dtype=float)
    weights, squared = nearest_on_triangles(np.array([[1.5, 1, 0], [1, 1, 3]]), triangles)
    np.testing.assert_allclose(np.einsum("pk,pkc->pc", weights, triangles), [[1.5, 0, 0], [1, 1, 1]])
    np.testing.assert_allclose(squared, [1, 4])


def test_walk_finds_the_nearest_point_of_a_convex_surface_from_anywhere() -> None:
    mesh = sphere(2)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200, 3))
    points *= np.maximum(1.05 / np.linalg.norm(points, axis=1), 1)[:, None]
    place = Surface(mesh).walk(points, rng.integers(0, mesh.n_faces, 200))
    found = np.linalg.norm(place.interpolate(mesh, mesh.vertices) - points, axis=1)
    least = np.min([nearest_on_triangles(points, np.broadcast_to(t, (200, 3, 3)))[1] for t in mesh.corners], axis=0)
    np.testing.assert_allclose(found, np.sqrt(least), atol=1e-9)
    np.testing.assert_allclose(place.barycentric.sum(axis=1), 1, atol=1e-12)


def test_vertices_are_surface_points_of_themselves() -> None:
    mesh = blob(2)
    place = Surface(mesh).at_vertices()
    np.testing.assert_array_equal(place.interpolate(mesh, mesh.vertices), mesh.vertices)
    np.testing.assert_array_equal(place.nearest_corner(mesh), np.arange(mesh.n_vertices))


def test_nearest_marks_are_nearest_along_the_edges() -> None:
    mesh = blob(2)
    rng = np.random.default_rng(1)
    marks = SurfacePoints(rng.choice(mesh.n_faces, 9, replace=False), rng.dirichlet([1, 1, 1], 9))
    graph = trimesh.graph.vertex_adjacency_graph(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))
    import networkx as nx

    for i, j in graph.edges:
        graph[i][j]["w"] = float(np.linalg.norm(mesh.vertices[i] - mesh.vertices[j]))
    where = marks.interpolate(mesh, mesh.vertices)
    rows = []
    for k, face in enumerate(marks.faces):
        for v in mesh.faces[face]:
            graph.add_edge(("mark", k), int(v), w=float(np.linalg.norm(mesh.vertices[v] - where[k])))
    for k in range(9):
        others = nx.restricted_view(graph, [("mark", j) for j in range(9) if j != k], [])
        lengths = nx.single_source_dijkstra_path_length(others, ("mark", k), weight="w")
        rows.append([lengths[v] for v in range(mesh.n_vertices)])
    np.testing.assert_array_equal(Surface(mesh).nearest_marks(marks), np.argmin(rows, axis=0))
