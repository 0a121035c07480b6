"""Refinement and independent remeshing: counts, topology, geometry, ground truth, determinism."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.check import check
from csm.mesh.remesh import Remeshed, refine, remesh
from csm.mesh.remesh.edge_moves import edge_table
from csm.mesh.shape import Mesh
from csm.mesh.surface import nearest_on_triangles
from tests.shapes import blob, cylinder, plane, sphere, torus

CLOSED = {"sphere": lambda: sphere(3), "torus": torus, "blob": lambda: blob(3)}
OPEN = {"plane": plane, "cylinder": cylinder}
SHAPES = CLOSED | OPEN


def euler(mesh: Mesh) -> int:
    return mesh.n_vertices - len(edge_table(mesh.faces).ends) + mesh.n_faces


def n_loops(mesh: Mesh) -> int:
    """Number of boundary loops: components of the graph of boundary edges."""
    table = edge_table(mesh.faces)
    return len(trimesh.graph.connected_components(table.ends[~table.inner])) if (~table.inner).any() else 0


def quality(mesh: Mesh) -> np.ndarray:
    squares = ((np.roll(mesh.corners, -1, axis=1) - mesh.corners) ** 2).sum(axis=(1, 2))
    return 4 * np.sqrt(3) * mesh.face_areas / squares


def mean_edge(mesh: Mesh) -> float:
    ends = edge_table(mesh.faces).ends
    return float(np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1).mean())


def assert_sound(old: Mesh, new: Mesh) -> None:
    """Manifold, oriented, same topology, no flipped pieces, nearly the same area."""
    kinds = {finding.kind for finding in check(new)}
    assert kinds <= {"boundary"}, kinds
    assert (euler(new), n_loops(new)) == (euler(old), n_loops(old))
    assert new.area == pytest.approx(old.area, rel=0.05)
    assert new.scale == old.scale


def brute_force_distance(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Distance of each point to the surface over all triangles."""
    least = np.full(len(points), np.inf)
    for triangle in mesh.corners:
        least = np.minimum(least, nearest_on_triangles(points, np.broadcast_to(triangle, (len(points), 3, 3)))[1])
    return np.sqrt(least)


@pytest.mark.parametrize("name", SHAPES)
def test_refine_keeps_the_vertices_first_and_the_surface(name: str) -> None:
    old = SHAPES[name]()
    result = refine(old, int(1.7 * old.n_vertices), seed=3)
    new = result.mesh
    assert new.n_vertices == int(1.7 * old.n_vertices)
    np.testing.assert_array_equal(new.vertices[: old.n_vertices], old.vertices)
    np.testing.assert_array_equal(result.truth.indices, np.arange(old.n_vertices))
    assert result.truth.n_to == new.n_vertices
    assert_sound(old, new)
    assert brute_force_distance(new.vertices, old).max() < 1e-9
    np.testing.assert_allclose(result.location.interpolate(new, new.vertices), old.vertices, atol=1e-12)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("factor", [0.6, 1.5])
def test_remesh_is_another_triangulation_of_the_same_surface(name: str, factor: float) -> None:
    old = SHAPES[name]()
    result = remesh(old, int(factor * old.n_vertices), seed=1)
    new = result.mesh
    assert new.n_vertices == int(factor * old.n_vertices)
    assert_sound(old, new)
    assert brute_force_distance(new.vertices, old).max() < 1e-9
    shared = (np.abs(new.vertices[:, None] - old.vertices[None]).max(axis=2) < 1e-9).any(axis=1).mean()
    assert shared < 0.35 if name in OPEN else shared < 0.02
    assert np.quantile(quality(new), 0.01) > 0.5


@pytest.mark.parametrize("name", SHAPES)
def test_remesh_truth_is_near_and_its_location_nearer(name: str) -> None:
    old = SHAPES[name]()
    result = remesh(old, old.n_vertices, seed=1)
    vertex = np.linalg.norm(result.mesh.vertices[result.truth.indices] - old.vertices, axis=1)
    point = np.linalg.norm(result.location.interpolate(result.mesh, result.mesh.vertices) - old.vertices, axis=1)
    assert vertex.max() < 1.5 * mean_edge(result.mesh)
    assert (point <= vertex + 1e-12).all()
    np.testing.assert_allclose(
        point, brute_force_distance(old.vertices, result.mesh), atol=0.1 * mean_edge(result.mesh)
    )


@pytest.mark.parametrize("make", [refine, remesh])
def test_same_seed_same_mesh_other_seed_other_mesh(make: Callable[..., Remeshed]) -> None:
    old = blob(2)
    a, b, c = make(old, 300, seed=5), make(old, 300, seed=5), make(old, 300, seed=6)
    assert a.mesh.digest == b.mesh.digest
    np.testing.assert_array_equal(a.truth.indices, b.truth.indices)
    assert a.mesh.digest != c.mesh.digest


def test_refine_to_the_same_count_keeps_every_vertex() -> None:
    old = blob(2)
    np.testing.assert_array_equal(refine(old, old.n_vertices).mesh.vertices, old.vertices)


def test_truth_stays_on_its_sheet() -> None:
    """A coin much thinner than its edges are long: no point of the upper side may go to the lower one."""
    ball = sphere(3)
    coin = Mesh(ball.vertices * [1, 1, 0.02], ball.faces)
    result = remesh(coin, 400, seed=0)
    flat = np.linalg.norm(coin.vertices[:, :2], axis=1) < 0.7
    assert mean_edge(result.mesh) > 4 * np.abs(coin.vertices[:, 2]).max()
    there = result.mesh.vertices[result.truth.indices[flat], 2]
    assert (there * coin.vertices[flat, 2] >= 0).all()


def test_unfit_meshes_and_counts_are_refused_with_a_reason() -> None:
    old = sphere(2)
    with pytest.raises(MeshError, match="cannot refine 162 vertices to 100"):
        refine(old, 100)
    fan = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]], "fan")
    with pytest.raises(MeshError, match=r"fan: .*more than two faces"):
        remesh(fan, 10)
    twisted = Mesh(old.vertices, np.concatenate([old.faces[:1, ::-1], old.faces[1:]]))
    with pytest.raises(MeshError, match="orient"):
        refine(twisted, 300)
    with pytest.raises(MeshError, match="stops at"):
        remesh(torus(n=8, m=6), 5)


@pytest.mark.data
def test_refine_of_a_real_shape_resembles_the_published_one(data_set: Callable[..., object]) -> None:
    """LPS-data's 10000-vertex FAUST: spread of edge lengths, and how many of the original edges survive."""
    from scipy.io import loadmat

    shape = loadmat(f"{data_set('FAUST_6890')}/shapes/tr_reg_080.mat")["shape"][0, 0]
    vertices = np.column_stack([shape[k].ravel() for k in "XYZ"])
    old = Mesh(vertices, shape["TRIV"].astype(int) - 1)
    published = trimesh.load(f"{data_set('FAUST_10000')}/tr_reg_080.off", process=False)
    theirs = Mesh(np.asarray(published.vertices), np.asarray(published.faces))
    ours = refine(old, 10000).mesh
    assert_sound(old, ours)

    def spread_and_survival(mesh: Mesh) -> tuple[float, float]:
        ends = edge_table(mesh.faces).ends
        length = np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)
        before, after = (t.ends @ [100_000, 1] for t in (edge_table(old.faces), edge_table(mesh.faces)))
        return float(length.std() / length.mean()), float(np.isin(before, after).mean())

    np.testing.assert_allclose(spread_and_survival(ours), spread_and_survival(theirs), atol=0.06)
