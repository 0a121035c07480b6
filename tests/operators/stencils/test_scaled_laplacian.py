from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.laplacian import stiffness
from csm.operators.stencils.scaled_laplacian import ScaledLaplacian, graph_laplacian
from tests.shapes import blob, cylinder, plane, sphere

SHAPES = [sphere(2), cylinder(n=9, m=8), plane(8), blob(2)]


def dense(mesh: Mesh, kind: str) -> np.ndarray:
    arrays = ScaledLaplacian(kind)(Operators(mesh))
    n = mesh.n_vertices
    return sparse.csr_array((arrays["values"], arrays["indices"], arrays["indptr"]), shape=(n, n)).toarray()


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_graph_laplacian_is_degree_less_adjacency(mesh):
    adjacency = np.zeros((mesh.n_vertices,) * 2)
    for a, b, c in mesh.faces:
        for i, j in ((a, b), (b, c), (c, a)):
            adjacency[i, j] = adjacency[j, i] = 1
    np.testing.assert_array_equal(graph_laplacian(mesh).toarray(), np.diag(adjacency.sum(axis=1)) - adjacency)


@pytest.mark.parametrize("kind", ["graph", "cotangent"])
@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_against_dense_eigenvalues(mesh, kind):
    plain = (stiffness(mesh) if kind == "cotangent" else graph_laplacian(mesh)).toarray()
    scale = np.diag(1 / np.sqrt(np.diag(plain)))
    normalised = scale @ plain @ scale
    expected = 2 * normalised / np.linalg.eigvalsh(normalised)[-1] - np.eye(mesh.n_vertices)
    found = dense(mesh, kind)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    np.testing.assert_array_equal(found, found.T)


@pytest.mark.parametrize("kind", ["graph", "cotangent"])
def test_size_and_numbering_play_no_part(kind):
    mesh = blob(2)
    before = dense(mesh, kind)
    np.testing.assert_allclose(dense(replace(mesh, vertices=3 * mesh.vertices), kind), before, atol=1e-9)
    new_of_old = np.random.default_rng(1).permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    after = dense(replace(mesh, vertices=vertices, faces=new_of_old[mesh.faces]), kind)
    np.testing.assert_allclose(after[new_of_old[:, None], new_of_old], before, atol=1e-5)


def test_other_laplacians_are_refused():
    with pytest.raises(ConfigError, match="graph, cotangent"):
        ScaledLaplacian("umbrella")
