from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy import sparse

from csm.errors import ConfigError, MeshError, NumericalError
from csm.mesh.shape import Mesh
from csm.operators import _eigensolver as solver
from csm.operators._factors import Factors
from csm.operators.laplacian import stiffness, vertex_areas
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum, eigenpairs, symmetrised
from tests.shapes import blob, plane, sphere, torus


def solve(mesh: Mesh, k: int) -> Spectrum:
    return eigenpairs(stiffness(mesh), vertex_areas(mesh), k, name=mesh.name)


def pieces(*meshes: Mesh) -> Mesh:
    """Several meshes as the components of one."""
    starts = np.cumsum([0] + [m.n_vertices for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.vertices + 5.0 * i for i, m in enumerate(meshes)]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)]),
        "pieces",
    )


def test_sphere_has_l_times_l_plus_1():
    evals = solve(sphere(4), 25).evals
    expected = np.concatenate([[degree * (degree + 1)] * (2 * degree + 1) for degree in range(5)])
    np.testing.assert_allclose(evals, expected, rtol=1e-2, atol=1e-9)


def test_flat_square_has_the_free_membrane_spectrum():
    evals = solve(plane(40), 8).evals
    i, j = np.meshgrid(range(6), range(6))
    np.testing.assert_allclose(evals, np.sort((np.pi**2 * (i**2 + j**2)).ravel())[:8], rtol=1e-2, atol=1e-9)


@pytest.mark.parametrize("k", [1, 2, 40])
def test_against_the_dense_generalised_problem(k):
    mesh = blob(3)
    found = solve(mesh, k)
    values, vectors = scipy.linalg.eigh(stiffness(mesh).toarray(), np.diag(vertex_areas(mesh)))
    np.testing.assert_allclose(found.evals, values[:k], rtol=1e-8, atol=1e-9)
    overlap = np.abs(found.evecs.T @ (vertex_areas(mesh)[:, None] * vectors[:, :k]))
    np.testing.assert_allclose(np.diag(overlap), 1, atol=1e-6)
    assert found.notes == ()


def test_the_tiny_edges_of_marching_cubes_are_no_obstacle(caplog):
    mesh = blob(4)
    vertices = mesh.vertices.copy()
    for centre in (0, 700, 1500):  # all faces around it become tiny
        ring = np.unique(mesh.faces[(mesh.faces == centre).any(axis=1)])
        vertices[ring] = vertices[centre] + 1e-5 * (vertices[ring] - vertices[centre])
    mesh = Mesh(vertices, mesh.faces, "tiny edges")
    with caplog.at_level(logging.WARNING):
        found = solve(mesh, 60)
    matrix = symmetrised(stiffness(mesh), 1 / np.sqrt(vertex_areas(mesh)))
    assert abs(matrix).max() > 1e9 * found.evals[-1]  # so that rounding alone exceeds a residual of 1e-7
    assert found.residual > 1e-7
    assert not found.notes
    assert not caplog.records
    values = scipy.linalg.eigvalsh(matrix.toarray())[:60]
    np.testing.assert_allclose(found.evals, values, rtol=1e-4, atol=1e-3)  # the dense solver's own rounding
    gram = found.evecs.T @ (found.mass[:, None] * found.evecs)
    np.testing.assert_allclose(gram, np.eye(60), atol=1e-8)


def test_lanczos_finds_more_copies_of_an_eigenvalue_than_its_blocks_have_columns():
    found = solve(pieces(*[sphere(2)] * 30), 40)  # 4,860 vertices, blocks of 4
    assert found.n_zero() == 30
    np.testing.assert_allclose(found.evals[30:], solve(sphere(2), 2).evals[1], rtol=1e-9)


def test_lanczos_agrees_with_the_dense_solver_on_many_pairs():
    matrix, mass = stiffness(blob(3)), vertex_areas(blob(3))
    scale = 1 / np.sqrt(mass)
    values, vectors = np.linalg.eigh(matrix.toarray() * scale[:, None] * scale)
    found = eigenpairs(matrix, mass, 150)
    np.testing.assert_allclose(found.evals[1:], values[1:150], rtol=1e-11)
    np.testing.assert_allclose((found.evecs[:, :100] ** 2).sum(axis=1), (vectors[:, :100] ** 2).sum(axis=1) / mass)


def test_a_small_mesh_gives_all_its_pairs():
    found = solve(sphere(1), 42)
    np.testing.assert_allclose(found.evecs.T @ (found.mass[:, None] * found.evecs), np.eye(42), atol=1e-10)
    with pytest.raises(ConfigError, match=r"sphere: asked for 43 eigenpairs, but 42 vertices"):
        solve(sphere(1), 43)
    with pytest.raises(ConfigError, match="asked for 0"):
        solve(sphere(1), 0)


def test_pairs_satisfy_the_equation_and_are_orthonormal_to_the_mass():
    mesh = torus()
    found, matrix = solve(mesh, 30), stiffness(mesh)
    np.testing.assert_allclose(matrix @ found.evecs, found.mass[:, None] * found.evecs * found.evals, atol=1e-9)
    np.testing.assert_allclose(found.evecs.T @ (found.mass[:, None] * found.evecs), np.eye(30), atol=1e-9)
    assert found.residual < 1e-9
    assert (np.diff(found.evals) >= 0).all()
    assert (found.evals >= 0).all()


def test_each_component_has_its_zero():
    found = solve(pieces(sphere(3), sphere(3), blob(2)), 12)
    np.testing.assert_allclose(found.evals[:3], 0, atol=1e-9)
    assert found.evals[3] > 0.1
    assert found.n_zero() == 3


def test_twins_have_every_eigenvalue_twice():
    np.testing.assert_allclose(
        solve(pieces(blob(3), blob(3)), 40).evals, np.repeat(solve(blob(3), 20).evals, 2), atol=1e-7
    )


def test_only_zeros_is_an_error_for_who_needs_more():
    with pytest.raises(NumericalError, match="one per component"):
        _ = solve(pieces(sphere(2), sphere(2)), 2).n_zero()


def test_answers_are_repeatable_to_the_bit_and_signs_fixed():
    first, second = solve(blob(3), 20), solve(blob(3), 20)
    np.testing.assert_array_equal(first.evecs, second.evecs)
    greatest = first.evecs[np.abs(first.evecs).argmax(axis=0), np.arange(20)]
    assert (greatest > 0).all()


def test_eigenvalues_go_with_the_inverse_area():
    mesh = blob(3)
    big = solve(replace(mesh, vertices=1000 * mesh.vertices), 10)
    np.testing.assert_allclose(1e6 * big.evals, solve(mesh, 10).evals, rtol=1e-7, atol=1e-9)
    assert big.n_zero() == 1


def test_slivers_do_not_spoil_the_residual():
    mesh = blob(4)
    vertices = mesh.vertices.copy()
    a, b, c = mesh.faces[0]
    vertices[a] = vertices[[b, c]].mean(axis=0) + 1e-6 * (vertices[a] - vertices[b])
    assert Operators(Mesh(vertices, mesh.faces, "sliver")).lbo(100).residual < 5e-9


def test_first_gives_the_smallest_pairs():
    found = solve(blob(2), 10)
    np.testing.assert_array_equal(found.first(4).evals, found.evals[:4])
    np.testing.assert_array_equal(found.first(4).evecs, found.evecs[:, :4])
    with pytest.raises(ConfigError, match="first 11 of 10"):
        found.first(11)


def test_an_eigenvalue_passed_over_is_noticed_and_the_retry_recorded(monkeypatch, caplog):
    honest, calls = solver._solve, []

    def forgetful(problem, attempt):
        calls.append(attempt)
        if len(calls) > 2:  # the first attempt, by single vectors, may pass over copies: that is no news
            return honest(problem, attempt)
        found = honest(problem._replace(k=problem.k + 1), attempt)
        kept = np.arange(problem.k + 1) != 5
        return solver.Pairs(found.evals[kept], found.evecs[:, kept])

    monkeypatch.setattr(solver, "_solve", forgetful)
    with caplog.at_level(logging.WARNING):
        found = solve(blob(3), 20)
    assert len(found.notes) == len(caplog.records) == 1
    assert "1 eigenvalue was passed over" in found.notes[0]
    monkeypatch.undo()
    np.testing.assert_allclose(found.evals, solve(blob(3), 20).evals, atol=1e-9)


def test_wrong_pairs_are_refused_after_three_attempts_with_the_name(monkeypatch):
    honest = solver._solve

    def sloppy(problem, attempt):
        found = honest(problem, attempt)
        return found._replace(evals=found.evals * 1.001)

    monkeypatch.setattr(solver, "_solve", sloppy)
    with pytest.raises(NumericalError, match=r"^blob: .*residual.*residual.*residual"):
        solve(blob(3), 20)


def test_a_shape_with_copies_of_eigenvalues_is_nothing_to_report():
    found = solve(sphere(4), 25)
    assert found.notes == ()
    assert found.residual < 1e-9


def test_factors_of_one_pattern_solve_and_count():
    matrix = sparse.csc_array(stiffness(blob(3)))
    values = np.linalg.eigvalsh(matrix.toarray())
    factors = Factors(matrix)
    for shift, scale in ((-1.0, 1.0), (0.5 * (values[20] + values[21]), 1.0), (3.0, 7.0)):
        scaled = sparse.csc_array((scale * matrix.data, matrix.indices, matrix.indptr), matrix.shape)
        assert factors.factor(scaled, shift) == (scale * values < shift).sum()
        right = np.random.default_rng(0).standard_normal((len(values), 3))
        np.testing.assert_allclose(scaled @ factors.solve(right) - shift * factors.solve(right), right, atol=1e-7)


def test_a_wrong_guess_of_the_density_changes_nothing():
    matrix, mass = stiffness(blob(3)), vertex_areas(blob(3))
    for density in (1e-4, 1e4):
        found = eigenpairs(matrix, mass, 20, density=density)
        np.testing.assert_allclose(found.evals, solve(blob(3), 20).evals, rtol=1e-9, atol=1e-9)
        assert found.notes == ()


def test_a_vertex_without_area_is_named():
    lonely = Mesh(np.vstack([sphere(1).vertices, [[9, 9, 9.0]]]), sphere(1).faces, "lonely")
    with pytest.raises(MeshError, match=r"lonely: 1 vertex has no area .* vertex 42"):
        solve(lonely, 3)


def test_matrices_that_are_not_finite_or_do_not_fit_are_refused():
    mesh = sphere(1)
    matrix, mass = stiffness(mesh), vertex_areas(mesh)
    with pytest.raises(ConfigError, match="41 masses"):
        eigenpairs(matrix, mass[:-1], 3)
    matrix.data[0] = np.nan
    with pytest.raises(MeshError, match="not finite"):
        eigenpairs(matrix, mass, 3)
