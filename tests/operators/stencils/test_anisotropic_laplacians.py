from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.laplacian import stiffness
from csm.operators.stencils.anisotropic_laplacians import AnisotropicLaplacians, scaled
from tests.shapes import blob, rotation, sphere

DEFAULTS = {"alpha": 10.0, "angles": 8, "frame": "line_field", "sweeps": 10, "smoothing": 0.08}


def matrices(mesh: Mesh, **options) -> list[np.ndarray]:
    arrays = AnisotropicLaplacians(**{**DEFAULTS, **options})(Operators(mesh))
    return [sparse.csr_array((v, arrays["indices"], arrays["indptr"])).toarray() for v in arrays["values"]]


def published(mesh: Mesh, alpha: float, theta: float, sweeps: int) -> np.ndarray:
    """The matrix of the publication, step by step and dense."""
    operators = Operators(mesh)
    S = operators.anisotropic(sweeps=sweeps).at(alpha, theta).toarray()
    A = np.diag(operators.mass)
    root = np.diag(np.abs(np.diag(np.linalg.inv(A) @ S)) ** -0.5)
    L = np.linalg.inv(A) @ (root @ S @ root)
    np.testing.assert_allclose(np.diag(L), 1)
    return 2 * L / np.linalg.eigvals(L).real.max() - np.eye(len(L))


def test_every_angle_is_similar_to_the_published_matrix():
    root = np.sqrt(Operators(blob(2)).mass)
    for j, M in enumerate(matrices(blob(2), angles=3)):
        expected = published(blob(2), 10.0, j * np.pi / 3, sweeps=10)
        np.testing.assert_allclose(M * root / root[:, None], expected, atol=1e-6)


@pytest.mark.parametrize("options", [{"angles": 8}, {"alpha": 0.0, "angles": 1}, {"frame": "smooth", "angles": 2}])
def test_matrices_are_symmetric_with_eigenvalues_from_minus_one_to_one(options):
    made = matrices(blob(2), **options)
    assert len(made) == options["angles"]
    for M in made:
        np.testing.assert_allclose(M, M.T, atol=1e-14)
        evals = np.linalg.eigvalsh(M)
        assert evals[0] == pytest.approx(-1, abs=1e-9)
        assert evals[-1] == pytest.approx(1, abs=1e-6)


def test_without_anisotropy_it_is_the_scaled_cotangent_matrix():
    made = AnisotropicLaplacians(**{**DEFAULTS, "alpha": 0.0, "angles": 1})(Operators(blob(2)))["values"][0]
    np.testing.assert_allclose(made, scaled(stiffness(blob(2))).data, atol=1e-12)


def test_angles_differ():
    first, second = matrices(blob(2), angles=2)
    assert np.abs(first - second).max() > 0.1


def test_motion_and_size_change_nothing_and_numbering_only_the_order():
    mesh, few = blob(2), {"angles": 2}
    moved = replace(mesh, vertices=3.0 * mesh.vertices @ rotation(5).T + np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(matrices(moved, **few), matrices(mesh, **few), atol=1e-6)
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    renumbered = replace(mesh, vertices=mesh.vertices[order], faces=np.argsort(order)[mesh.faces])
    before = [M[np.ix_(order, order)] for M in matrices(mesh, **few)]
    np.testing.assert_allclose(matrices(renumbered, **few), before, atol=1e-6)


def test_dense_and_iterative_eigenvalues_agree():
    large, small = scaled(stiffness(sphere(2))), scaled(stiffness(sphere(1)))
    for matrix in (large, small):
        assert np.linalg.eigvalsh(matrix.toarray())[-1] == pytest.approx(1, abs=1e-6)


def test_a_vertex_without_stiffness_is_left_alone():
    S = sparse.csr_array(np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    S.data[-1] = 0.0
    np.testing.assert_allclose(scaled(S).toarray(), [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], atol=1e-12)


@pytest.mark.parametrize("wrong", [{"alpha": -1.0}, {"alpha": float("nan")}, {"angles": 0}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        AnisotropicLaplacians(**{**DEFAULTS, **wrong})
