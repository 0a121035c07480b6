from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import HKS
from csm.errors import ConfigError
from csm.operators import Operators
from tests.shapes import blob, sphere


@pytest.mark.parametrize("scaled", [True, False])
def test_against_a_loop(scaled):
    operators = Operators(blob(2))
    spectrum = operators.lbo(30)
    values = HKS(k=30, n_times=7, scaled=scaled)(operators).values
    start, stop = 4 * np.log(10) / spectrum.evals[-1], 4 * np.log(10) / spectrum.evals[1]
    for column, step in enumerate(np.linspace(0, 1, 7)):
        t = start * (stop / start) ** step
        heat, trace = np.zeros(operators.mesh.n_vertices), 0.0
        for value, vector in zip(spectrum.evals, spectrum.evecs.T, strict=True):
            heat += np.exp(-value * t) * vector**2
            trace += np.exp(-value * t)
        np.testing.assert_allclose(values[:, column], heat / trace if scaled else heat, rtol=1e-10)


def test_scaled_columns_integrate_to_one():
    operators = Operators(blob(3))
    np.testing.assert_allclose(operators.mass @ HKS(k=50, n_times=20)(operators).values, 1, rtol=1e-9)


def test_all_points_of_a_sphere_are_alike():
    values = HKS(k=49, n_times=10)(sphere(3)).values
    np.testing.assert_allclose(values, 1, rtol=0.05)


def test_given_times_are_the_same_for_every_shape_and_in_the_record():
    fixed = HKS(k=30, n_times=3, scaled=False, first=0.01, last=1.0)
    operators = Operators(blob(2))
    spectrum = operators.lbo(30)
    expected = [spectrum.evecs**2 @ np.exp(-t * spectrum.evals) for t in (0.01, 0.1, 1.0)]
    np.testing.assert_allclose(fixed(operators).values, np.stack(expected, axis=1), rtol=1e-10)
    assert HKS(**fixed.parameters()) == fixed
    assert set(HKS().parameters()) == {"k", "n_times", "scaled"}, "keys of what is in a store already stay"


@pytest.mark.parametrize(
    "wrong",
    [{"k": 1}, {"n_times": 1}, {"first": 0.1}, {"last": 0.1}, {"first": 1.0, "last": 0.1}, {"first": 0, "last": 1}],
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        HKS(**wrong)
