"""Distances on surfaces where they are known, on ugly ones, and single pairs against whole rows."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from csm.errors import ConfigError, MeshError
from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh
from csm.operators._pairs import plan_pairs
from csm.operators.geodesic import Method, geodesics
from tests.shapes import blob, cylinder, plane, sphere, torus

METHODS: list[Method] = ["exact", "heat", "edge"]


def all_rows(mesh: Mesh, method: Method) -> np.ndarray:
    return geodesics(mesh, method).rows(np.arange(mesh.n_vertices))


def two_pieces() -> Mesh:
    """Two squares far apart, and vertex 8 in no face."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(np.concatenate([square, square + 5, [[9, 9, 9]]]), np.concatenate([faces, faces + 4]), "pieces")


def test_exact_is_euclidean_on_a_convex_plane() -> None:
    mesh = plane()
    np.testing.assert_allclose(all_rows(mesh, "exact"), cdist(mesh.vertices, mesh.vertices), atol=1e-10)


def test_exact_on_a_sphere_is_the_great_circle_to_mesh_accuracy() -> None:
    mesh = sphere(4)
    row = geodesics(mesh, "exact").rows(np.array([7]))[0]
    circle = np.arccos(np.clip(mesh.vertices @ mesh.vertices[7], -1, 1))
    # The inscribed polyhedron is shorter by a relative error of the order of (edge / radius)^2 / 24.
    assert np.abs(row - circle).max() < 0.004 * np.pi
    assert np.all(row >= np.linalg.norm(mesh.vertices - mesh.vertices[7], axis=1) - 1e-12)


def test_exact_unrolls_a_cylinder() -> None:
    mesh = cylinder(radius=0.5, height=3.0, n=24, m=30)
    row = geodesics(mesh, "exact").rows(np.array([0]))[0]
    side = 2 * 0.5 * np.sin(np.pi / 24)
    steps = np.minimum(np.arange(24), 24 - np.arange(24))
    expected = np.hypot(side * steps[:, None], np.linspace(0, 3, 30)[None, :]).ravel()
    np.testing.assert_allclose(row, expected, atol=1e-9)


def test_edge_graph_is_a_metric_above_exact_and_heat_is_near_exact() -> None:
    mesh = blob(2)
    exact, edge, heat = (all_rows(mesh, method) for method in ("exact", "edge", "heat"))
    off = ~np.eye(mesh.n_vertices, dtype=bool)
    assert np.all(edge >= exact - 1e-9)
    assert 1.0 < np.mean(edge[off] / exact[off]) < 1.12
    assert np.mean(np.abs(heat[off] / exact[off] - 1)) < 0.05


@pytest.mark.parametrize("method", ["exact", "edge"])
def test_symmetric_and_triangle_inequality(method: Method) -> None:
    d = all_rows(torus(n=16, m=8), method)
    np.testing.assert_allclose(d, d.T, atol=1e-9)
    assert np.all(d[:, None, :] <= d[:, :, None] + d[None, :, :].transpose(0, 2, 1) + 1e-9)
    assert np.all(np.diag(d) == 0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("make", [partial(blob, 2), partial(torus, n=16, m=8), plane, two_pieces])
def test_pairs_are_entries_of_rows(method: Method, make: Callable[[], Mesh]) -> None:
    mesh = make()
    rng = np.random.default_rng(0)
    sources, targets = rng.integers(0, mesh.n_vertices, (2, 300))
    targets[:200] = np.minimum(sources[:200] + rng.integers(0, 5, 200), mesh.n_vertices - 1)
    surface = geodesics(mesh, method)
    np.testing.assert_allclose(surface.pairs(sources, targets), all_rows(mesh, method)[sources, targets], atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_no_path_is_infinitely_far(method: Method) -> None:
    surface = geodesics(two_pieces(), method)
    rows = surface.rows(np.array([0, 8]))
    assert np.isfinite(rows[0]).tolist() == [True] * 4 + [False] * 5
    assert np.isfinite(rows[1]).tolist() == [False] * 8 + [True]
    assert surface.pairs(np.array([0, 8, 8, 2]), np.array([4, 0, 8, 2])).tolist() == [np.inf, np.inf, 0.0, 0.0]
    assert surface.pairs(np.array([], dtype=int), np.array([], dtype=int)).shape == (0,)


def test_relabelling_and_scale() -> None:
    mesh = blob(2)
    order = np.random.default_rng(3).permutation(mesh.n_vertices)
    new_label = np.argsort(order)
    moved = Mesh(10 * mesh.vertices[order], new_label[mesh.faces])
    for method in METHODS:
        a = geodesics(mesh, method).rows(order[:5])[:, order]
        np.testing.assert_allclose(geodesics(moved, method).rows(np.arange(5)), 10 * a, rtol=1e-5, atol=1e-6)


def test_diameter_of_known_shapes() -> None:
    assert geodesics(plane(), "exact").diameter() == pytest.approx(np.sqrt(2))
    assert geodesics(sphere(3, radius=2.0), "exact").diameter() == pytest.approx(2 * np.pi, rel=0.01)
    assert geodesics(two_pieces(), "edge").diameter() == pytest.approx(2.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_diameter_is_a_lower_bound_that_more_rows_tighten(seed: int) -> None:
    mesh = blob(2, seed)
    truth = all_rows(mesh, "edge").max()
    few, many = geodesics(mesh, "edge").diameter(), geodesics(mesh, "edge").diameter(max_rows=mesh.n_vertices)
    assert 0.85 * truth <= few <= truth + 1e-12
    assert many == pytest.approx(truth)


def test_far_pairs_share_their_sources() -> None:
    hub, n = 0, 500
    line = np.column_stack([np.arange(n), np.zeros((n, 2))]).astype(float)
    others = np.arange(1, n)
    plan = plan_pairs(line, np.where(others % 2, others, hub), np.where(others % 2, hub, others), symmetric=True)
    assert plan.sources.tolist() == [hub]
    ordered = plan_pairs(line, others, np.full(n - 1, hub), symmetric=False)
    assert len(ordered.sources) == n - 1


@pytest.mark.parametrize("symmetric", [True, False])
def test_plan_answers_every_pair_once(symmetric: bool) -> None:
    rng = np.random.default_rng(1)
    sources, targets = rng.integers(0, 40, (2, 3000))
    sources, targets = sources[sources != targets], targets[sources != targets]
    plan = plan_pairs(rng.normal(size=(40, 3)), sources, targets, symmetric)
    asked = np.repeat(plan.sources, np.diff(plan.starts))[plan.inverse], plan.targets[plan.inverse]
    same = (asked[0] == sources) & (asked[1] == targets)
    turned = (asked[0] == targets) & (asked[1] == sources)
    assert np.all(same | turned) if symmetric else np.all(same)
    unordered = {(min(p), max(p)) if symmetric else p for p in zip(sources.tolist(), targets.tolist(), strict=True)}
    assert len(plan.targets) == len(unordered)


@pytest.mark.parametrize(
    ("faces", "what"),
    [
        ([[0, 1, 2], [0, 2, 3], [0, 2, 4]], "more than two faces"),
        ([[0, 1, 2], [0, 3, 4]], "several fans"),
        ([[0, 1, 2], [1, 1, 2]], "no length"),
        ([[0, 1, 2], [2, 5, 3]], "no length"),
    ],
)
def test_exact_refuses_what_would_crash_it(faces: list[list[int]], what: str) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1], [1, 1, 0.0]])
    mesh = Mesh(vertices, np.array(faces), "ugly")
    with pytest.raises(MeshError, match=f"ugly.*{what}"):
        geodesics(mesh, "exact")
    assert np.isfinite(geodesics(mesh, "edge").rows(np.array([0]))[0, mesh.faces]).all()


def test_wrong_questions_are_refused() -> None:
    with pytest.raises(ConfigError, match="fast"):
        geodesics(sphere(1), "fast")  # type: ignore[arg-type]
    surface = geodesics(sphere(1), "edge")
    with pytest.raises(ConfigError, match="vertex 42"):
        surface.rows(np.array([42]))
    with pytest.raises(ConfigError, match="go in pairs"):
        surface.pairs(np.array([1, 2]), np.array([1]))
    with pytest.raises(MeshError, match="has none"):
        geodesics(Mesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=int)), "exact")


@pytest.mark.data
def test_pairs_on_a_body_equal_full_rows(data_set: Callable[[str], Path]) -> None:
    mesh = read_mesh(data_set("FAUST_6890") / "shapes" / "tr_reg_085.mat")
    rng = np.random.default_rng(0)
    sources = np.repeat(rng.integers(0, mesh.n_vertices, 5), 60)
    surface = geodesics(mesh, "exact")
    rows = surface.rows(np.unique(sources))
    near = np.argsort(rows, axis=1)[:, 1:200]
    here = np.searchsorted(np.unique(sources), sources)
    targets = np.where(rng.random(300) < 0.8, near[here, rng.integers(0, 199, 300)], rng.integers(0, 6890, 300))
    np.testing.assert_allclose(surface.pairs(sources, targets), rows[here, targets], atol=1e-6)


def test_a_vertex_that_no_window_has_reached_goes_by_its_neighbours():
    mesh = blob(2)
    whole = geodesics(mesh, "exact").rows(np.array([0]))[0]
    lossy = geodesics(mesh, "exact")
    near, far = mesh.faces[-1, :2]
    exact = lossy.algorithm

    class Losing:
        def geodesicDistances(self, sources, targets, limit):
            found, *rest = exact.geodesicDistances(sources, targets, limit)
            return np.where(np.isin(targets, (near, far)), np.inf, found), *rest

    lossy.algorithm = Losing()
    row = lossy.rows(np.array([0]))[0]
    assert np.isfinite(lossy.diameter())
    np.testing.assert_array_equal(np.delete(row, [near, far]), np.delete(whole, [near, far]))
    longest = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2).max()
    assert (whole[[near, far]] <= row[[near, far]]).all()
    assert (row[[near, far]] <= whole[[near, far]] + longest).all()
    assert lossy.pairs(np.array([0]), np.array([near])) == row[near]
