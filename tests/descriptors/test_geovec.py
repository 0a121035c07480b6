from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.geovec import geometry_vectors, spline_weights
from csm.operators import Operators
from tests.shapes import blob


def bump(x: float) -> float:
    """Cubic B-spline on [0, 4], by its truncated powers."""
    if not 0 < x < 4:
        return 0.0
    binomials = (1, -4, 6, -4, 1)
    return sum(b * max(x - j, 0.0) ** 3 for j, b in enumerate(binomials)) / 6


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_against_a_loop_over_splines_and_pairs(shift):
    spectrum = Operators(blob(2)).lbo(30)
    n, step = 12, spectrum.evals[-1] / 11
    values = geometry_vectors(spectrum.evals, spectrum.evecs, n, step, shift=shift)
    for i in range(n):
        expected = sum(
            bump(value / step - i + shift) * vector**2
            for value, vector in zip(spectrum.evals, spectrum.evecs.T, strict=True)
        )
        np.testing.assert_allclose(values[:, i], expected, atol=1e-10 * np.abs(values).max())


def test_splines_share_out_the_range_of_their_knots():
    evals = np.linspace(3.0, 20.0, 200)
    np.testing.assert_allclose(spline_weights(evals, 21, 1.0).sum(axis=1), 1, atol=1e-12)
    assert spline_weights(np.array([5.0]), 21, 1.0, shift=2.0).argmax() == 5
    assert spline_weights(np.array([5.0]), 21, 1.0).argmax() == 3


def test_nothing_lies_outside_the_support():
    weights = spline_weights(np.array([-1e-9, 0.0, 4.0, 1e6]), 1, 1.0)
    np.testing.assert_array_equal(weights, 0)
