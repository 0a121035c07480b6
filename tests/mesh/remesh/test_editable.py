"""The moves of a editable keep its vertices on the surface and do what they say."""

from __future__ import annotations

import numpy as np
import pytest

from csm.mesh.remesh.editable import LONG, EditableMesh
from csm.mesh.shape import Mesh
from tests.shapes import blob, plane, sphere


def editable_of(mesh: Mesh, size: float, n_fixed: int = 0) -> EditableMesh:
    return EditableMesh(mesh, np.full(mesh.n_vertices, size), n_fixed, np.random.default_rng(0))


def assert_on_surface(editable: EditableMesh) -> None:
    mesh = editable.surface.mesh
    np.testing.assert_allclose(editable.place.interpolate(mesh, mesh.vertices), editable.vertices, atol=1e-12)


def opposite_angles(editable: EditableMesh) -> np.ndarray:
    table = editable.table()
    ends, apexes = editable.vertices[table.ends[table.inner]], editable.vertices[table.opposite[table.inner]]
    total = np.zeros(len(ends))
    for k in range(2):
        u, v = ends[:, 0] - apexes[:, k], ends[:, 1] - apexes[:, k]
        total += np.arccos((u * v).sum(1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1))
    return total


def test_splits_shorten_and_collapses_lengthen_until_edges_fit() -> None:
    editable = editable_of(blob(2), 0.2)
    while editable.split_longest(editable.n, LONG):
        assert_on_surface(editable)
    assert editable.relative_lengths(editable.table()).max() < 1.03 * LONG
    before = editable.n
    removed = editable.collapse_shortest(editable.n, 0.8)
    assert removed > 0
    assert editable.n == before - removed == len(np.unique(editable.faces))
    assert_on_surface(editable)


def test_counts_are_upper_limits() -> None:
    editable = editable_of(sphere(2), 0.01)
    assert editable.split_longest(7, LONG) == 7
    editable = editable_of(sphere(3), 1.0)
    assert editable.collapse_shortest(5, 0.8) == 5


def test_flips_make_a_flat_mesh_delaunay() -> None:
    mesh = plane(12)
    editable = editable_of(mesh, 0.1)
    editable.scatter(0.3)
    editable.flip(50)
    assert opposite_angles(editable).max() < np.pi + 2e-3


def test_relaxing_evens_the_triangles_and_leaves_the_fixed_and_the_boundary() -> None:
    mesh = plane(12)
    editable = editable_of(mesh, 0.1, n_fixed=40)
    before = mesh.face_areas.std()
    for _ in range(5):
        editable.relax()
    assert Mesh(editable.vertices, editable.faces).face_areas.std() < 0.8 * before
    rim = (np.abs(mesh.vertices[:, :2] - 0.5) > 0.499).any(axis=1)
    stays = rim | (np.arange(mesh.n_vertices) < 40)
    np.testing.assert_array_equal(editable.vertices[stays], mesh.vertices[stays])
    assert (np.abs(editable.vertices - mesh.vertices).max(axis=1) > 1e-4)[~stays].mean() > 0.9
    assert_on_surface(editable)


def test_corners_of_the_boundary_outlive_every_collapse() -> None:
    editable = editable_of(plane(12), 0.5)
    for _ in range(20):
        editable.collapse_shortest(editable.n, 0.8)
    corners = np.array([[x, y, 0] for x in (0, 1) for y in (0, 1)])
    distance = np.linalg.norm(editable.vertices[:, None] - corners, axis=2).min(axis=0)
    np.testing.assert_allclose(distance, 0, atol=1e-12)
    assert editable.n < 80


def test_a_thin_rim_is_not_eaten_away() -> None:
    ball = sphere(3)
    editable = editable_of(Mesh(ball.vertices * [1, 1, 0.02], ball.faces), 0.25)
    for _ in range(10):
        editable.collapse_shortest(editable.n, 0.8)
    assert Mesh(editable.vertices, editable.faces).area == pytest.approx(editable.surface.mesh.area, rel=0.05)
