from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import WKS
from csm.descriptors.wks import wave_band
from csm.errors import ConfigError
from csm.operators import Operators
from tests.shapes import blob


def energies_and_width(variant: str, low: float, high: float, n: int) -> tuple[np.ndarray, float]:
    if variant == "aubry":
        energies = np.linspace(low, high / 1.02, n)
        return energies, 6 * (energies[1] - energies[0])
    sigma = 7 * (high - low) / n
    return np.linspace(low + 2 * sigma, high - 2 * sigma, n), sigma


@pytest.mark.parametrize("variant", ["aubry", "functional_map"])
def test_against_a_loop(variant):
    operators = Operators(blob(2))
    spectrum = operators.lbo(30)
    values = WKS(k=30, n_energies=40, variant=variant)(operators).values
    logs = np.log(np.maximum(spectrum.evals, 1e-6))
    energies, sigma = energies_and_width(variant, logs[1], logs[-1], 40)
    first = 0 if variant == "aubry" else 1
    for column, energy in enumerate(energies):
        total, norm = np.zeros(operators.mesh.n_vertices), 0.0
        for k in range(first, 30):
            f = np.exp(-((energy - logs[k]) ** 2) / (2 * sigma**2))
            total += f * spectrum.evecs[:, k] ** 2
            norm += f
        np.testing.assert_allclose(values[:, column], total / norm, rtol=1e-9)


def test_columns_integrate_to_one():
    operators = Operators(blob(3))
    np.testing.assert_allclose(operators.mass @ WKS(k=50)(operators).values, 1, rtol=1e-9)


def test_windows_far_from_every_eigenvalue_stay_finite():
    assert np.isfinite(WKS(k=6, n_energies=5000)(blob(2)).values).all()


def test_functional_map_band_is_narrower_by_28_per_cent_of_the_range_at_100():
    band = wave_band(1.0, np.e, 100, "functional_map")
    assert band.energies[-1] - band.energies[0] == pytest.approx(0.72)


@pytest.mark.parametrize(
    "wrong", [{"k": 1}, {"n_energies": 1}, {"variant": "short"}, {"variant": "functional_map", "n_energies": 28}]
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match=r"wanted|one of"):
        WKS(**wrong)


def test_no_range_of_energies_is_an_error():
    with pytest.raises(ConfigError, match="raise k"):
        WKS(k=2)(blob(2))
