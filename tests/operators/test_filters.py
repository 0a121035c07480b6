from __future__ import annotations

import numpy as np
import pytest

from csm.operators.filters import filter_names, mexican_hat_filters, meyer_filters, unit_sums


def meyer_by_cases(x: float, low_pass: bool) -> float:
    """The scaling function or the wavelet of Meyer at x = t lambda, interval by interval."""

    def nu(y: float) -> float:
        return y**4 * (35 - 84 * y + 70 * y**2 - 20 * y**3)

    if x < 2 / 3:
        return 1.0 if low_pass else 0.0
    if x < 4 / 3:
        return (np.cos if low_pass else np.sin)(np.pi / 2 * nu(1.5 * x - 1))
    return np.cos(np.pi / 2 * nu(0.75 * x - 1)) if not low_pass and x < 8 / 3 else 0.0


def test_meyer_against_its_definition_by_cases():
    evals, n, greatest = np.linspace(0, 50, 301), 6, 50.0
    filters = meyer_filters(evals, n, greatest)
    scales = [4 / (3 * greatest) * 2 ** (n - 1 - j) for j in range(1, n)]
    for value, row in zip(evals, filters, strict=True):
        expected = [meyer_by_cases(scales[0] * value, True), *(meyer_by_cases(t * value, False) for t in scales)]
        np.testing.assert_allclose(row, expected, atol=1e-14)


@pytest.mark.parametrize("n", [2, 5, 10])
def test_squares_of_meyer_filters_sum_to_one_up_to_the_greatest_eigenvalue(n):
    evals = np.linspace(0, 7.0, 1001)
    np.testing.assert_allclose((meyer_filters(evals, n, 7.0) ** 2).sum(axis=1), 1, atol=1e-12)


def test_a_meyer_filter_without_an_eigenvalue_in_its_support_is_exactly_zero():
    """Else rounding would be blown up when filters are divided by their sums."""
    filters = meyer_filters(np.array([0.0, 9.0, 10.0]), 10, 10.0)
    np.testing.assert_array_equal(filters[0], [1] + 9 * [0])
    np.testing.assert_array_equal(filters[:, 1:8], 0)
    np.testing.assert_array_equal(unit_sums(filters)[:, 1:8], 0)


def test_meyer_low_pass_of_ten_ends_at_a_256th_of_the_band():
    evals = np.array([0.999, 1.001]) * 100 / 256
    low_pass = meyer_filters(evals, 10, 100.0)[:, 0]
    assert low_pass[0] > 0
    assert low_pass[1] == 0


def test_mexican_hats_against_a_loop():
    evals, greatest, n = np.linspace(0, 40, 17), 40.0, 32
    top = 1.01 * greatest
    low = top / 20
    filters = mexican_hat_filters(evals, n, greatest)
    assert filters.shape == (17, 32)
    for j in range(31):
        t = np.exp(np.log(2.3 / low) + (np.log(0.2 / top) - np.log(2.3 / low)) * j / 30)
        for k, value in enumerate(evals):
            expected = 0.443 * (t * value) ** 2 * np.exp(1 - (t * value) ** 2)
            assert filters[k, j + 1] == pytest.approx(expected, rel=1e-10, abs=1e-300)
    np.testing.assert_allclose(filters[:, 0], 1.004 * np.exp(-((evals / (0.52 * low)) ** 3)), rtol=1e-12)


def test_banks_run_from_coarse_to_fine():
    evals = np.linspace(0.0, 1.0, 2001)
    for filters in (meyer_filters(evals, 6, 1.0), mexican_hat_filters(evals, 6, 1.0)):
        centres = evals @ filters / filters.sum(axis=0)
        assert (np.diff(centres) > 0).all()
        assert len(filter_names(6)) == 6


def test_unit_sums():
    np.testing.assert_allclose(unit_sums(np.array([[1.0, 0.0], [3.0, 0.0]])), [[0.25, 0], [0.75, 0]])
