"""Functional maps and vertex maps, against sums, least squares and all distances."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.distance import cdist

from csm.errors import ConfigError
from csm.matching.functional import FunctionalMap, functional_map, orthogonal, vertex_map
from tests.matching.pairs import bent, relabelled, spectrum_of
from tests.matching.peers import geomfum_basis, need, same_map
from tests.shapes import blob, sphere


@pytest.fixture(scope="module")
def spectra():
    mesh = blob(2)
    return spectrum_of(mesh, 20), spectrum_of(bent(blob(3)), 20)


@pytest.fixture
def anywhere(spectra):
    rng = np.random.default_rng(0)
    return rng.integers(0, len(spectra[1].mass), len(spectra[0].mass))


def test_it_is_the_sum_over_the_vertices_of_the_source(spectra, anywhere):
    source, target = spectra
    found = functional_map(anywhere, source, target, 7, 5)
    assert found.shape == (7, 5)
    wanted = np.zeros((7, 5))
    for x, y in enumerate(anywhere):
        wanted += source.mass[x] * np.outer(source.evecs[x, :7], target.evecs[y, :5])
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_left_out_vertices_are_left_out_of_the_least_squares(spectra, anywhere):
    source, target = spectra
    partial = np.where(np.arange(len(anywhere)) % 3 == 0, -1, anywhere)
    at = np.flatnonzero(partial >= 0)
    weights = np.sqrt(source.mass[at])[:, None]
    wanted = np.linalg.lstsq(weights * source.evecs[at, :6], weights * target.evecs[partial[at], :6], rcond=None)[0]
    np.testing.assert_allclose(functional_map(partial, source, target, 6), wanted, atol=1e-10)


def test_with_all_eigenfunctions_it_pulls_every_function_back_exactly():
    source, target = spectrum_of(sphere(0), 12), spectrum_of(blob(1), 42)
    rng = np.random.default_rng(1)
    indices, f = rng.integers(0, 42, 12), rng.normal(size=42)
    matrix = FunctionalMap(functional_map(indices, source, target, 12, 42))
    coefficients = target.evecs.T @ (target.mass * f)
    np.testing.assert_allclose(source.evecs @ matrix.pull(coefficients), f[indices], atol=1e-10)


def test_of_an_isometry_it_is_orthogonal_and_commutes_and_gives_the_map_back():
    mesh = blob(2)
    other, truth = relabelled(mesh)
    source, target = spectrum_of(mesh, 30), spectrum_of(other, 30)
    matrix = functional_map(truth, source, target, 30)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(30), atol=1e-6)
    np.testing.assert_allclose(matrix * target.evals, source.evals[:, None] * matrix, atol=1e-3)
    for adjoint in (False, True):
        np.testing.assert_array_equal(vertex_map(matrix, source, target, adjoint=adjoint), truth)


@pytest.mark.parametrize("shape", [(9, 9), (9, 6), (5, 8)])
def test_vertex_maps_are_the_least_of_all_distances(spectra, shape):
    source, target = spectra
    matrix = np.random.default_rng(2).normal(size=shape)
    phi, psi = source.evecs[:, : shape[0]], target.evecs[:, : shape[1]]
    pulled = cdist(phi @ matrix, psi).argmin(1)
    carried = cdist(phi, psi @ matrix.T).argmin(1)
    np.testing.assert_array_equal(vertex_map(matrix, source, target, device="cpu"), pulled)
    np.testing.assert_array_equal(vertex_map(matrix, source, target, adjoint=True), carried)
    assert (pulled != carried).any()


def test_of_an_orthogonal_matrix_both_forms_agree(spectra):
    matrix = orthogonal(np.random.default_rng(3).normal(size=(9, 9)))
    pulled, carried = (vertex_map(matrix, *spectra, adjoint=adjoint) for adjoint in (False, True))
    np.testing.assert_array_equal(pulled, carried)


@pytest.mark.parametrize("shape", [(6, 6), (6, 4), (4, 6)])
def test_the_nearest_orthogonal_matrix_is_the_polar_factor(shape):
    matrix = np.random.default_rng(4).normal(size=shape)
    found = orthogonal(matrix)
    np.testing.assert_allclose(found, scipy.linalg.polar(matrix)[0], atol=1e-12)
    np.testing.assert_allclose(FunctionalMap(matrix).orthogonal().matrix, found)


def test_an_unknown_device_is_an_error(spectra):
    with pytest.raises(RuntimeError):
        vertex_map(np.eye(4), *spectra, device="nowhere")


def test_too_few_vertices_or_eigenpairs_are_refused(spectra, anywhere):
    source, target = spectra
    few = np.full_like(anywhere, -1)
    few[:5] = anywhere[:5]
    with pytest.raises(ConfigError, match="5 matched vertices cannot give a functional map of 6"):
        functional_map(few, source, target, 6)
    with pytest.raises(ConfigError, match="first 21 of 20"):
        functional_map(anywhere, source, target, 21)
    with pytest.raises(ConfigError, match="first 21 of 20"):
        vertex_map(np.zeros((20, 21)), source, target)


@pytest.mark.parametrize("wrong", [np.zeros(3), np.full((2, 2), np.nan), np.zeros((2, 2, 2))])
def test_only_finite_matrices_are_functional_maps(wrong):
    with pytest.raises(ConfigError, match="wanted a matrix of finite numbers"):
        FunctionalMap(wrong)


def test_a_functional_map_pulls_several_functions_and_says_whose_it_is():
    matrix = np.arange(6).reshape(3, 2)
    made = FunctionalMap(matrix, "a", "b")
    functions = np.random.default_rng(5).normal(size=(2, 4, 5))
    np.testing.assert_allclose(made.pull(functions)[:, 1, 2], matrix @ functions[:, 1, 2])
    assert repr(made) == "FunctionalMap(of a -> b, 3 x 2)"
    assert repr(made.orthogonal()) == repr(made)


@pytest.mark.peers
def test_functional_maps_are_those_of_pyfm_and_geomfum(small_spectra):
    source, target, truth = small_spectra
    found = functional_map(truth, source, target, 20, 15)
    pyfm = need("pyFM.spectral").p2p_to_FM(truth, target.evecs[:, :15], source.evecs[:, :20], A2=source.mass)
    np.testing.assert_allclose(found, pyfm, atol=1e-10)
    convert = need("geomfum.convert").FmFromP2pConverter(pseudo_inverse=True)
    np.testing.assert_allclose(convert(truth, geomfum_basis(target, 15), geomfum_basis(source, 20)), found, atol=1e-10)


@pytest.mark.peers
@pytest.mark.parametrize("adjoint", [False, True])
def test_vertex_maps_are_those_of_pyfm_and_geomfum(small_spectra, adjoint):
    """What csm calls the adjoint form is the default of both, and what they call the adjoint is csm's default."""
    source, target, truth = small_spectra
    matrix = functional_map(truth, source, target, 20, 15)
    found = vertex_map(matrix, source, target, adjoint=adjoint)
    assert same_map(found, need("pyFM.spectral").FM_to_p2p(matrix, target.evecs, source.evecs, use_adj=not adjoint))
    convert = need("geomfum.convert").P2pFromFmConverter(adjoint=not adjoint)
    assert same_map(found, convert(matrix, geomfum_basis(target), geomfum_basis(source)))
    assert not same_map(found, vertex_map(matrix, source, target, adjoint=not adjoint))
