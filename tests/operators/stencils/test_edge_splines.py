from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.mesh.topology import directed_edges
from csm.operators import Operators
from csm.operators.stencils.edge_splines import EdgeSplines, linear_splines, pseudo_coordinates
from tests.shapes import blob, cylinder, plane, rotation, sphere

SHAPES = [sphere(1), cylinder(n=8, m=5), plane(6), blob(2)]


def matrices(mesh: Mesh, kernel: int) -> np.ndarray:
    """The matrices of all control points, dense, shape (kernel^3, N, N)."""
    arrays = EdgeSplines(kernel)(Operators(mesh))
    dense = np.zeros((kernel**3, mesh.n_vertices, mesh.n_vertices))
    for m in range(kernel**3):
        for row in range(arrays["offsets"][m], arrays["offsets"][m + 1]):
            here = slice(arrays["indptr"][row], arrays["indptr"][row + 1])
            dense[m, arrays["targets"][row], arrays["indices"][here]] = arrays["values"][here]
    return dense


def brute_force(mesh: Mesh, kernel: int) -> np.ndarray:
    n = mesh.n_vertices
    neighbours = np.zeros((n, n), dtype=bool)
    for face in mesh.faces:
        for a in face:
            for b in face:
                neighbours[a, b] |= a != b
    steps = mesh.vertices[None, :] - mesh.vertices[:, None]
    u = steps / (2 * np.abs(steps[neighbours]).max()) + 0.5
    dense = np.zeros((kernel**3, n, n))
    for m in range(kernel**3):
        control = np.array([m % kernel, m // kernel % kernel, m // kernel**2])
        hats = np.maximum(1 - np.abs(u * (kernel - 1) - control), 0)
        dense[m] = hats.prod(axis=2) * neighbours
    return dense


@pytest.mark.parametrize("kernel", [2, 5])
@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_against_hat_functions_on_all_pairs_of_vertices(mesh, kernel):
    np.testing.assert_allclose(matrices(mesh, kernel), brute_force(mesh, kernel), atol=1e-12)


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_the_transpose_is_the_matrix_of_the_mirrored_control_point(mesh):
    dense = matrices(mesh, 5)
    np.testing.assert_allclose(dense[::-1].swapaxes(1, 2), dense, atol=1e-14)


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_matrices_share_out_the_neighbours(mesh):
    total = matrices(mesh, 4).sum(axis=0)
    np.testing.assert_allclose(total[total != 0], 1)
    np.testing.assert_array_equal((total != 0).sum(axis=1), EdgeSplines(4)(Operators(mesh))["degrees"])
    assert (total != 0).sum() == len(directed_edges(mesh.faces, mesh.n_vertices).targets)


def test_coordinates_fill_the_unit_cube_and_mirror_on_the_way_back():
    mesh = blob(2)
    edges = directed_edges(mesh.faces, mesh.n_vertices)
    u = pseudo_coordinates(mesh, edges)
    assert u.min() >= 0
    assert u.max() <= 1
    assert np.abs(u - 0.5).max() == pytest.approx(0.5)
    back = np.lexsort((edges.targets, edges.sources))
    np.testing.assert_allclose(u[back], 1 - u, atol=1e-15)


def test_the_ends_of_the_range_belong_to_the_outermost_points():
    corners = linear_splines(np.array([[0.0, 0.5, 1.0]]), 5)
    used = corners.weights[0] > 0
    assert corners.points[0, used].tolist() == [0 + 2 * 5 + 4 * 25]
    assert corners.weights[0, used].tolist() == [1.0]


def test_moving_and_scaling_change_nothing_and_turning_does():
    mesh = blob(2)
    before = matrices(mesh, 5)
    moved = replace(mesh, vertices=3 * mesh.vertices + np.array([1.0, -2.0, 0.5]))
    np.testing.assert_allclose(matrices(moved, 5), before, atol=1e-9)
    turned = replace(mesh, vertices=mesh.vertices @ rotation(3).T)
    assert np.abs(matrices(turned, 5) - before).max() > 0.1


def test_relabelling_the_vertices_relabels_the_matrices():
    mesh = blob(2)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    after = matrices(replace(mesh, vertices=vertices, faces=new_of_old[mesh.faces]), 5)
    np.testing.assert_allclose(after[:, new_of_old[:, None], new_of_old], matrices(mesh, 5), atol=1e-12)


def test_a_kernel_of_one_point_is_refused():
    with pytest.raises(ConfigError, match="at least 2"):
        EdgeSplines(1)
