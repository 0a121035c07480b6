from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import WKS
from csm.descriptors.amks import AMKS, average_mixing_kernel_signature, energy_band
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, mirrored, size
from tests.shapes import blob

SMALL = AMKS(k=20, n_energies=12)
UNIT = AMKS(k=20, n_energies=12, units="unit_area")


def enlarged(mesh: Mesh) -> Mesh:
    return replace(mesh, vertices=3.0 * mesh.vertices)


def by_loops(evals: np.ndarray, evecs: np.ndarray, descriptor: AMKS) -> np.ndarray:
    logs = np.log(np.maximum(evals, 1e-6))
    energies = np.linspace(logs[1], logs[-1] / 1.02, descriptor.n_energies)
    sigma = descriptor.variance * (energies[1] - energies[0])
    values = np.zeros((len(evecs), len(energies)))
    for column, energy in enumerate(energies):
        f = np.exp(-((energy - logs) ** 2) / (2 * sigma**2))
        norm = 0.0
        for a in range(len(evals)):
            for b in range(len(evals)):
                z = descriptor.time * (evals[a] - evals[b])
                mixed = 1.0 if z == 0 else np.sin(z) / z
                values[:, column] += evecs[:, a] ** 2 * f[a] * f[b] * mixed * evecs[:, b] ** 2
                norm += f[a] * f[b] if a <= b else 0.0
        values[:, column] /= norm
    return values


@pytest.mark.parametrize(("time", "variance"), [(0.5, 6.0), (0.01, 2.0), (3.0, 6.0)])
def test_against_a_double_loop_in_the_units_of_the_file(time, variance):
    mesh = enlarged(blob(2))
    spectrum = Operators(mesh, unit_area=False).lbo(20)
    descriptor = replace(SMALL, time=time, variance=variance)
    expected = by_loops(spectrum.evals, spectrum.evecs, descriptor)
    for shape in (mesh, Operators(mesh), Operators(mesh, unit_area=False)):
        np.testing.assert_allclose(descriptor(shape).values, expected, rtol=1e-6)


def test_against_a_double_loop_at_unit_area():
    spectrum = Operators(blob(2)).lbo(20)
    expected = by_loops(spectrum.evals, spectrum.evecs, UNIT)
    for shape in (blob(2), enlarged(blob(2)), Operators(enlarged(blob(2)), unit_area=False)):
        np.testing.assert_allclose(UNIT(shape).values, expected, rtol=1e-6)


def test_time_is_absolute_in_the_units_of_the_file():
    small, large = (SMALL(mesh).values for mesh in (blob(2), enlarged(blob(2))))
    shape_small, shape_large = (values / np.linalg.norm(values, axis=0) for values in (small, large))
    assert np.abs(shape_large - shape_small).max() > 0.01 * shape_small.max()


def test_no_time_gives_the_square_of_the_wave_kernel_signature():
    operators = Operators(blob(3))
    waves = WKS(k=40, n_energies=30)(operators).values
    ratio = AMKS(k=40, n_energies=30, time=0.0, units="unit_area")(operators).values / waves**2
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[0], ratio.shape), rtol=1e-9)
    assert (ratio > 1).all()  # (sum f)^2 over the half of its terms with a <= b
    assert (ratio < 2).all()


def test_long_time_leaves_the_diagonal():
    operators = Operators(blob(2))
    spectrum = operators.lbo(20)
    band = energy_band(spectrum.evals[1], spectrum.evals[-1], 5, 6.0)
    values = average_mixing_kernel_signature(spectrum.evals, spectrum.evecs**2, band, 1e9)
    for column, energy in enumerate(band.energies):
        f = np.exp(-((energy - np.log(np.maximum(spectrum.evals, 1e-6))) ** 2) / (2 * band.sigma**2))
        norm = np.triu(np.outer(f, f)).sum()
        np.testing.assert_allclose(values[:, column], spectrum.evecs**4 @ f**2 / norm, rtol=1e-6)


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("descriptor", [SMALL, UNIT], ids=["original", "unit_area"])
def test_invariance(descriptor, check):
    if check is size and descriptor is SMALL:
        pytest.skip("its time is absolute, as the tests above state")
    check(descriptor)


def test_a_mirror_changes_nothing():
    before = SMALL(blob(3)).values
    np.testing.assert_allclose(SMALL(mirrored(blob(3))).values, before, rtol=1e-6)


def test_windows_far_from_every_eigenvalue_stay_finite():
    assert np.isfinite(AMKS(k=6, n_energies=5000)(blob(2)).values).all()


def test_memory_grows_with_the_number_of_vertices_only():
    evals, densities = np.arange(50.0), np.random.default_rng(0).random((5000, 50))
    tracemalloc.start()
    average_mixing_kernel_signature(evals, densities, energy_band(1.0, 49.0, 4, 6.0), 0.5)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * densities.nbytes


@pytest.mark.parametrize("wrong", [{"k": 1}, {"n_energies": 1}, {"variance": 0.0}, {"time": -1.0}, {"units": "metres"}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match=r"wanted|one of"):
        AMKS(**wrong)


def test_no_range_of_energies_is_an_error():
    with pytest.raises(ConfigError, match="raise k"):
        AMKS(k=2, units="unit_area")(blob(2))
