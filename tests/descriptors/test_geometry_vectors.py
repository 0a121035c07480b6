from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors.geometry_vectors import GeometryVectors
from csm.errors import ConfigError
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.descriptors.test_geovec import bump
from tests.shapes import blob

SMALL = GeometryVectors(k=30, n_splines=12)


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(SMALL)


@pytest.mark.parametrize("unit_area", [True, False])
@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_against_a_loop_over_splines_and_pairs(shift, unit_area):
    mesh = replace(blob(2), vertices=3.0 * blob(2).vertices)
    operators = Operators(mesh, unit_area=unit_area)
    spectrum = operators.lbo(25)
    last = 0.7 * 4 * np.pi * 25 / operators.mesh.area
    raw = np.zeros((mesh.n_vertices, 6))
    for i in range(6):
        for value, vector in zip(spectrum.evals, spectrum.evecs.T, strict=True):
            raw[:, i] += bump(value / (last / 5) - i + shift) * vector**2
    scale = np.abs(raw).max()
    plain = GeometryVectors(25, 6, 0.7, shift, normalise=False)
    np.testing.assert_allclose(plain(operators).values, raw, atol=1e-9 * scale)
    unit = raw / np.linalg.norm(raw, axis=1)[:, None]
    np.testing.assert_allclose(replace(plain, normalise=True)(operators).values, unit, atol=1e-9)


def test_a_filter_of_the_splines_is_a_linear_layer_of_the_columns():
    """Any spline filter tau gives sum_k tau(lambda_k) phi_k^2, the form of heat and wave kernel signatures."""
    operators, weights = Operators(blob(2)), np.random.default_rng(0).normal(size=12)
    spectrum = operators.lbo(30)
    step = 0.89 * 4 * np.pi * 30 / 11
    tau = np.array([sum(w * bump(x / step - i) for i, w in enumerate(weights)) for x in spectrum.evals])
    values = replace(SMALL, normalise=False)(operators).values
    np.testing.assert_allclose(values @ weights, spectrum.evecs**2 @ tau, rtol=1e-9)


def test_the_knots_do_not_depend_on_the_last_eigenvalue():
    """Two shapes with other eigenvalues have the same filters, so that columns can be compared."""
    values = [replace(SMALL, k=30, normalise=False)(Operators(blob(2, seed))).values for seed in (1, 2)]
    for mine, seed in zip(values, (1, 2), strict=True):
        spectrum = Operators(blob(2, seed)).lbo(30)
        integrals = [sum(bump(x / (0.89 * 4 * np.pi * 30 / 11) - i) for x in spectrum.evals) for i in range(12)]
        mass = Operators(blob(2, seed)).mass
        np.testing.assert_allclose(mass @ mine, integrals, atol=1e-9)


def test_a_mirror_image_has_the_same_rows():
    assert_close(SMALL(mirrored(blob(3))).values, SMALL(blob(3)).values)


def test_rows_have_unit_length():
    np.testing.assert_allclose(np.linalg.norm(SMALL(blob(2)).values, axis=1), 1)


@pytest.mark.parametrize("wrong", [{"k": 1}, {"n_splines": 1}, {"reach": 0.0}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        GeometryVectors(**wrong)
