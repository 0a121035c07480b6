from __future__ import annotations

import logging

import numpy as np
import pytest
from scipy import sparse

from csm.errors import ConfigError, MeshError, NumericalError
from csm.mesh.shape import Mesh
from csm.operators import multilevel
from csm.operators import operators as operators_module
from csm.operators.coarsening import coarsen
from csm.operators.laplacian import stiffness, vertex_areas
from csm.operators.multilevel import TOLERANCE, most_pairs, multilevel_eigenpairs
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum, eigenpairs
from tests.shapes import blob, plane, sphere


def both_ways(mesh: Mesh, matrix: sparse.csr_array, k: int) -> tuple[Spectrum, Spectrum]:
    areas = vertex_areas(mesh)
    return multilevel_eigenpairs(matrix, areas, k, coarsen(mesh)), eigenpairs(matrix, areas, k)


def density(spectrum: Spectrum) -> np.ndarray:
    """What a descriptor is made of: unlike eigenvectors it does not turn where eigenvalues are close."""
    weights = np.cos(np.outer(np.arange(4), np.arccos(2 * spectrum.evals / spectrum.evals[-1] - 1)))
    return spectrum.evecs**2 @ weights.T


def assert_close(found: Spectrum, wanted: Spectrum) -> None:
    assert 0 < found.residual <= TOLERANCE
    assert np.abs(found.evals - wanted.evals).max() <= 3 * TOLERANCE**2 * wanted.evals[-1]
    gram = found.evecs.T @ (found.mass[:, None] * found.evecs)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-9)
    error = density(found) - density(wanted)
    assert np.linalg.norm(error) <= 2 * TOLERANCE * np.linalg.norm(density(wanted))


@pytest.mark.parametrize("mesh", [blob(4), plane(50)], ids=lambda mesh: mesh.name)
@pytest.mark.parametrize("k", [2, 12, 40])
def test_as_the_direct_way(mesh: Mesh, k: int):
    found, wanted = both_ways(mesh, stiffness(mesh), k)
    assert_close(found, wanted)
    assert found.evals[0] == 0


def test_as_many_pairs_as_a_coarse_mesh_allows():
    mesh = blob(4)
    found, wanted = both_ways(mesh, stiffness(mesh), most_pairs(coarsen(mesh)))
    assert_close(found, wanted)


@pytest.mark.parametrize("theta", [0.0, 0.7])
def test_anisotropic_as_the_direct_way(theta: float):
    operators = Operators(blob(4))
    found, wanted = both_ways(operators.mesh, operators.anisotropic().at(10.0, theta), 10)
    assert_close(found, wanted)


def test_copies_of_an_eigenvalue_are_all_found():
    evals = multilevel_eigenpairs(stiffness(sphere(5)), vertex_areas(sphere(5)), 16, coarsen(sphere(5))).evals
    expected = np.concatenate([[degree * (degree + 1)] * (2 * degree + 1) for degree in range(4)])
    np.testing.assert_allclose(evals, expected, rtol=1e-2, atol=1e-9)


def test_one_zero_per_component():
    one = blob(4)
    n = one.n_vertices
    mesh = Mesh(
        np.concatenate([one.vertices, 1.3 * one.vertices + 9]), np.concatenate([one.faces, one.faces + n]), "two"
    )
    found, wanted = both_ways(mesh, stiffness(mesh), 9)
    assert found.n_zero() == wanted.n_zero() == 2
    assert (found.evals[:2] == 0).all()
    np.testing.assert_allclose(found.evals, wanted.evals, rtol=1e-5)


def test_it_is_the_same_every_time():
    mesh = blob(4)
    one, two = (multilevel_eigenpairs(stiffness(mesh), vertex_areas(mesh), 8, coarsen(mesh)) for _ in range(2))
    np.testing.assert_array_equal(one.evecs, two.evecs)


def test_too_many_pairs_are_refused():
    mesh = sphere(1)
    with pytest.raises(ConfigError, match=r"asked for 10 eigenpairs from a coarse mesh of \d vertices"):
        multilevel_eigenpairs(stiffness(mesh), vertex_areas(mesh), 10, coarsen(mesh))


def test_a_vertex_without_area_is_named():
    mesh, areas = blob(4), vertex_areas(blob(4))
    areas[7] = 0.0
    with pytest.raises(MeshError, match=r"1 vertex has no area around them \(the first is vertex 7\)"):
        multilevel_eigenpairs(stiffness(mesh), areas, 8, coarsen(mesh))


@pytest.fixture
def all_are_big(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operators_module, "DIRECT_UP_TO", 1000)


@pytest.mark.usefixtures("all_are_big")
def test_operators_take_it_for_big_meshes():
    mesh = blob(4)
    found = Operators(mesh).lbo(12)
    operators = Operators(mesh)
    assert_close(found, eigenpairs(stiffness(operators.mesh), operators.mass, 12))
    assert found.residual > 1e-6  # which the direct way would not leave
    assert Operators(mesh).albo(10.0, 0.4, 10).residual > 1e-6


@pytest.mark.usefixtures("all_are_big")
def test_operators_factor_for_more_pairs_than_the_coarse_mesh_has():
    operators = Operators(blob(4))
    k = len(operators.coarse.seeds) // 2
    assert operators.lbo(k).residual < 1e-7


@pytest.mark.usefixtures("all_are_big")
def test_operators_factor_after_all_if_it_does_not_converge(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr(multilevel, "_STEPS", 1)
    mesh = blob(4)
    with caplog.at_level(logging.WARNING):
        found = Operators(mesh).lbo(12)
    assert "were not refined to 1e-03 in 1 step" in caplog.text
    assert "which takes time and memory" in caplog.text
    assert found.residual < 1e-7


def test_no_convergence_is_an_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(multilevel, "_STEPS", 1)
    mesh = blob(4)
    with pytest.raises(NumericalError, match=r"blob.* 12 eigenpairs of [\d,]+ vertices were not refined"):
        multilevel_eigenpairs(stiffness(mesh), vertex_areas(mesh), 12, coarsen(mesh), name="blob")
