from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import HKS, WKS
from csm.descriptors.geovec import geometry_vectors
from csm.descriptors.windowed import require_known, shape_index, surface_functions, unit_columns, windowed_energies
from csm.errors import ConfigError, NumericalError
from csm.operators import Operators
from tests.shapes import blob, cylinder, plane, sphere, torus


@pytest.mark.parametrize("theta", [None, 0.7])
@pytest.mark.parametrize("tau", [0.002, 0.05])
def test_energies_against_dense_windows(theta, tau):
    operators = Operators(blob(2), unit_area=False)
    spectrum = operators.lbo(40) if theta is None else operators.albo(100.0, theta, 40)
    phi, lam, mass = spectrum.evecs, spectrum.evals, spectrum.mass
    f = np.random.default_rng(0).normal(size=(operators.mesh.n_vertices, 2))
    area = operators.mesh.area
    response = np.exp(-tau * area * np.abs(lam[0] - lam))
    expected = np.zeros_like(f)
    for x in range(len(f)):
        norm = np.sqrt((response**2 * phi[x] ** 2).sum())
        window = np.array([(response * phi[x] * phi[y]).sum() / norm for y in range(len(f))])
        assert mass @ window**2 == pytest.approx(1)
        for p in range(2):
            transform = np.sqrt(area) * np.array([(mass * f[:, p] * phi[:, k] * window).sum() for k in range(40)])
            expected[x, p] = (lam**2 / (lam**2).sum() * transform**2).sum()
    np.testing.assert_allclose(windowed_energies(spectrum, f, [1.0, tau])[:, 1], expected, rtol=1e-9)


def test_energy_is_of_second_degree_in_the_function():
    spectrum = Operators(blob(2)).lbo(30)
    f = np.random.default_rng(0).normal(size=(162, 1))
    np.testing.assert_allclose(
        windowed_energies(spectrum, -3 * f, [0.01]), 9 * windowed_energies(spectrum, f, [0.01]), rtol=1e-12
    )


def test_functions_are_those_of_their_own_modules():
    operators, k = Operators(blob(2)), 60
    names = ("constant", "fiedler", "geovec3", "hks80", "wks80", "shape_index")
    values = surface_functions(operators, names, k, spline_shift=2.0, index_sweeps=10)
    spectrum = operators.lbo(k)
    splines = geometry_vectors(spectrum.evals, spectrum.evecs, 150, spectrum.evals[-1] / 149, shift=2.0)
    expected = (
        np.ones(162),
        spectrum.evecs[:, 1],
        splines[:, 2],
        HKS(k=k, n_times=100, scaled=False)(operators).values[:, 79],
        WKS(k=k, n_energies=100)(operators).values[:, 79],
        shape_index(operators.mesh, 10),
    )
    for column, function in zip(values.T, expected, strict=True):
        np.testing.assert_allclose(column, function, rtol=1e-12)


def test_shape_index_of_known_surfaces():
    np.testing.assert_allclose(shape_index(cylinder(), 10), -0.5, atol=1e-9)
    np.testing.assert_array_equal(shape_index(plane(), 10), 0)
    assert (shape_index(sphere(3), 0) < -0.9).all()
    ring = torus(n=60, m=30)
    index, outside = shape_index(ring, 2), np.hypot(ring.vertices[:, 0], ring.vertices[:, 1])
    assert (index[outside > 1.2] < -0.5).all()
    assert (np.abs(index[outside < 0.8]) < 0.5).all()


def test_shape_index_changes_sign_inside_out():
    mesh = blob(2)
    turned = replace(mesh, faces=mesh.faces[:, ::-1])
    np.testing.assert_allclose(shape_index(turned, 3), -shape_index(mesh, 3), atol=1e-9)


def test_columns_of_unit_length_over_vertices_and_over_area():
    values = np.random.default_rng(0).normal(size=(162, 3))
    values[:, 1] = 0
    mass = Operators(blob(2)).mass
    np.testing.assert_allclose((unit_columns(values, mass, "vertices") ** 2).sum(axis=0), [1, 0, 1])
    np.testing.assert_allclose(mass @ unit_columns(values, mass, "area") ** 2, [1, 0, 1])


@pytest.mark.parametrize("name", ["geovec", "geovec0", "geovec151", "hks101", "constant1", "colour", "", "a b"])
def test_unknown_functions_are_refused(name):
    with pytest.raises(ConfigError, match="fiedler"):
        require_known([name])


@pytest.mark.parametrize("functions", [(), ("constant", "constant")])
def test_no_function_or_one_twice_is_refused(functions):
    with pytest.raises(ConfigError, match="each once"):
        require_known(functions)


def test_nothing_but_zero_eigenvalues_is_an_error():
    with pytest.raises(NumericalError, match="one per component"):
        windowed_energies(Operators(blob(2)).lbo(1), np.ones((162, 1)), [0.01])
