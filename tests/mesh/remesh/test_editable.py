"""The moves of a draft keep its vertices on the surface and do what they say."""

from __future__ import annotations

import numpy as np
import pytest

from csm.mesh.remesh.editable import LONG, Draft
from csm.mesh.shape import Mesh
from tests.shapes import blob, plane, sphere


def draft_of(mesh: Mesh, size: float, n_fixed: int = 0) -> Draft:
    return Draft(mesh, np.full(mesh.n_vertices, size), n_fixed, np.random.default_rng(0))


def assert_on_surface(draft: Draft) -> None:
    mesh = draft.surface.mesh
    np.testing.assert_allclose(draft.place.interpolate(mesh, mesh.vertices), draft.vertices, atol=1e-12)


def opposite_angles(draft: Draft) -> np.ndarray:
    table = draft.table()
    ends, apexes = draft.vertices[table.ends[table.inner]], draft.vertices[table.opposite[table.inner]]
    total = np.zeros(len(ends))
    for k in range(2):
        u, v = ends[:, 0] - apexes[:, k], ends[:, 1] - apexes[:, k]
        total += np.arccos((u * v).sum(1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1))
    return total


def test_splits_shorten_and_collapses_lengthen_until_edges_fit() -> None:
    draft = draft_of(blob(2), 0.2)
    while draft.split_longest(draft.n, LONG):
        assert_on_surface(draft)
    assert draft.relative_lengths(draft.table()).max() < 1.03 * LONG
    before = draft.n
    removed = draft.collapse_shortest(draft.n, 0.8)
    assert removed > 0
    assert draft.n == before - removed == len(np.unique(draft.faces))
    assert_on_surface(draft)


def test_counts_are_upper_limits() -> None:
    draft = draft_of(sphere(2), 0.01)
    assert draft.split_longest(7, LONG) == 7
    draft = draft_of(sphere(3), 1.0)
    assert draft.collapse_shortest(5, 0.8) == 5


def test_flips_make_a_flat_mesh_delaunay() -> None:
    mesh = plane(12)
    draft = draft_of(mesh, 0.1)
    draft.scatter(0.3)
    draft.flip(50)
    assert opposite_angles(draft).max() < np.pi + 2e-3


def test_relaxing_evens_the_triangles_and_leaves_the_fixed_and_the_boundary() -> None:
    mesh = plane(12)
    draft = draft_of(mesh, 0.1, n_fixed=40)
    before = mesh.face_areas.std()
    for _ in range(5):
        draft.relax()
    assert Mesh(draft.vertices, draft.faces).face_areas.std() < 0.8 * before
    rim = (np.abs(mesh.vertices[:, :2] - 0.5) > 0.499).any(axis=1)
    stays = rim | (np.arange(mesh.n_vertices) < 40)
    np.testing.assert_array_equal(draft.vertices[stays], mesh.vertices[stays])
    assert (np.abs(draft.vertices - mesh.vertices).max(axis=1) > 1e-4)[~stays].mean() > 0.9
    assert_on_surface(draft)


def test_corners_of_the_boundary_outlive_every_collapse() -> None:
    draft = draft_of(plane(12), 0.5)
    for _ in range(20):
        draft.collapse_shortest(draft.n, 0.8)
    corners = np.array([[x, y, 0] for x in (0, 1) for y in (0, 1)])
    distance = np.linalg.norm(draft.vertices[:, None] - corners, axis=2).min(axis=0)
    np.testing.assert_allclose(distance, 0, atol=1e-12)
    assert draft.n < 80


def test_a_thin_rim_is_not_eaten_away() -> None:
    ball = sphere(3)
    draft = draft_of(Mesh(ball.vertices * [1, 1, 0.02], ball.faces), 0.25)
    for _ in range(10):
        draft.collapse_shortest(draft.n, 0.8)
    assert Mesh(draft.vertices, draft.faces).area == pytest.approx(draft.surface.mesh.area, rel=0.05)
