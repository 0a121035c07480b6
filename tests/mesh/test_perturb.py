from __future__ import annotations

import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.check import check
from csm.mesh.perturb import grown_together, with_noise, with_slivers, without_part
from csm.mesh.shape import Mesh
from tests.shapes import sphere, torus


def solid(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def horseshoe() -> Mesh:
    """A closed bent tube whose two ends nearly touch."""
    straight = trimesh.creation.capsule(height=6.0, radius=0.4, count=[16, 16]).subdivide().subdivide_to_size(0.3)
    x, y, z = straight.vertices.T
    angle = (z - z.mean()) * (1.75 * np.pi / np.ptp(z))
    bent = np.stack([(1.3 + x) * np.cos(angle), (1.3 + x) * np.sin(angle), y], 1)
    return Mesh(bent, straight.faces, "horseshoe")


def test_noise_is_in_units_of_the_mean_edge():
    mesh = sphere(4)
    edge = solid(mesh).edges_unique_length.mean()
    moved = with_noise(mesh, 0.3, seed=1)
    assert (moved.mesh.vertices - mesh.vertices).std() == pytest.approx(0.3 * edge, rel=0.03)
    np.testing.assert_array_equal(moved.mesh.faces, mesh.faces)
    np.testing.assert_array_equal(with_noise(mesh, 0.3, seed=1).mesh.vertices, moved.mesh.vertices)
    np.testing.assert_array_equal(with_noise(mesh, 0.0).mesh.vertices, mesh.vertices)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.9])
def test_slivers_keep_the_surface_and_its_vertices_and_are_thin(share):
    mesh = sphere(4)
    made = with_slivers(mesh, share, seed=3)
    count = round(share * mesh.n_vertices)
    assert made.mesh.n_vertices == mesh.n_vertices + count
    np.testing.assert_array_equal(made.mesh.vertices[: mesh.n_vertices], mesh.vertices)
    assert made.kept.tolist() == [*range(mesh.n_vertices), *[-1] * count]
    assert made.mesh.area == pytest.approx(mesh.area, rel=1e-12)
    assert {finding.kind for finding in check(made.mesh)} == set()
    lengths = np.linalg.norm(np.diff(made.mesh.corners[:, [0, 1, 2, 0]], axis=1), axis=2)
    thin = (lengths.min(axis=1) < 0.12 * lengths.max(axis=1)).sum()
    assert count <= thin <= 2 * count, "each new vertex makes one or two thin faces"
    np.testing.assert_array_equal(with_slivers(mesh, share, seed=3).mesh.faces, made.mesh.faces)


def test_slivers_need_a_manifold():
    fan = Mesh(np.eye(5, 3) + np.arange(5)[:, None], [[0, 1, 2], [1, 0, 3], [0, 1, 4]], "three faces at an edge")
    with pytest.raises(MeshError, match=r"three faces at an edge.*manifold"):
        with_slivers(fan, 0.5)


@pytest.mark.parametrize("fraction", [0.1, 0.4])
def test_the_part_that_is_cut_lies_around_the_centre_and_has_its_area(fraction):
    mesh = sphere(4)
    left = without_part(mesh, 7, fraction)
    assert left.mesh.area / mesh.area == pytest.approx(1 - fraction, abs=0.01)
    np.testing.assert_array_equal(left.mesh.vertices, mesh.vertices[left.kept])
    gone = np.setdiff1d(np.arange(mesh.n_vertices), left.kept)
    height = mesh.vertices @ mesh.vertices[7]
    assert height[gone].min() > height[left.kept].max() - 0.15
    assert solid(left.mesh).euler_number == 1, "one hole"


def test_only_the_largest_of_what_is_left_is_kept():
    mesh = torus(n=40, m=20)
    whole = np.concatenate([mesh.vertices, 0.1 * sphere(2).vertices + 5])
    both = Mesh(whole, np.concatenate([mesh.faces, sphere(2).faces + mesh.n_vertices]), "two")
    left = without_part(both, 0, 0.2)
    assert left.kept.max() < mesh.n_vertices


def test_nothing_left_is_an_error():
    with pytest.raises(MeshError, match="leaves nothing"):
        without_part(sphere(2), 0, 1.1)


def test_a_bridge_joins_what_is_near_in_space_and_far_on_the_surface():
    mesh = horseshoe()
    joined = grown_together(mesh, far=0.6)
    body = solid(joined.mesh)
    assert solid(mesh).euler_number == 2
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.euler_number == 0, "one handle more"
    np.testing.assert_array_equal(joined.mesh.vertices, mesh.vertices)
    bridge = joined.mesh.faces[-6:]
    assert np.ptp(joined.mesh.vertices[bridge], axis=1).max() < 1.2, "it is as short as the gap"


def test_a_surface_without_far_faces_is_an_error():
    with pytest.raises(MeshError, match="ask for less"):
        grown_together(sphere(2), far=50)


def test_what_a_cut_leaves_is_a_manifold():
    touching = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [3, 3, 0], [3, 4, 0]], dtype=float),
        np.array([[0, 1, 2], [0, 3, 4], [1, 5, 2], [5, 6, 2]]),
        "two fans at 0",
    )
    left = without_part(touching, 6, 0.1)
    assert sorted(left.kept.tolist()) == [0, 1, 2, 5, 6]


def test_ends_of_a_bridge_do_not_touch():
    with pytest.raises(MeshError, match="the two ends of the bridge touch"):
        grown_together(sphere(0), 0.01)
