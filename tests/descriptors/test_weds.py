from __future__ import annotations

import math

import numpy as np
import pytest

from csm.descriptors.weds import WEDS, aggregate, gathering_filters, wavelet_energies
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.filters import mexican_hat_filters
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.shapes import blob, sphere


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(WEDS(k=20, n_filters=6, levels=2))


def test_mirror_image_changes_nothing():
    descriptor, mesh = WEDS(k=40), blob(3)
    assert_close(descriptor(mirrored(mesh)).values, descriptor(mesh).values)


def test_against_loops_over_vertices_filters_and_pairs():
    operators = Operators(blob(1, seed=3))
    n, k, n_filters, levels = operators.mesh.n_vertices, 12, 5, 2
    spectrum = operators.lbo(k + 1)
    phi, lam, a, x = spectrum.evecs[:, 1:], spectrum.evals[1:], spectrum.mass, operators.mesh.vertices
    g = mexican_hat_filters(lam, n_filters, lam[-1])
    c = [[sum(a[v] * phi[v, m] * x[v, i] for v in range(n)) for i in range(3)] for m in range(k)]
    total = [sum(g[m, s] ** 2 for s in range(n_filters)) for m in range(k)]
    energy = np.zeros((n, n_filters))
    for v in range(n):
        for s in range(n_filters):
            product = 0.0
            for i in range(3):
                one = sum(phi[v, m] * g[m, s] * total[m] * lam[m] ** 2 * c[m][i] for m in range(k))
                two = sum(phi[v, m] * g[m, s] * c[m][i] for m in range(k))
                product += a[v] * one * two
            energy[v, s] = math.sqrt(abs(product))
    np.testing.assert_allclose(wavelet_energies(lam, phi, a, x, g), energy, rtol=1e-9, atol=1e-9 * energy.max())

    columns = []
    for r in (3, 2):  # floor(linspace(5, 1, 4)) without its ends, counted from 1
        q = np.zeros((n, n))
        for v in range(n):
            for y in range(n):
                q[v, y] = sum(phi[v, m] * g[m, r - 1] * phi[y, m] * a[y] for m in range(k)) ** 2
        columns.append((q / np.linalg.norm(q, axis=0)).T @ energy)
    expected = np.hstack(columns)
    assert_close(WEDS(k, n_filters, levels)(operators).values, expected, 1e-5)


def test_four_of_thirty_two_filters_gather_in_the_published_order():
    np.testing.assert_array_equal(gathering_filters(32, 4) + 1, [25, 19, 13, 7])
    assert WEDS().columns[32] == "level 19 low-pass"
    assert WEDS().columns[127] == "level 7 wavelet 31"


@pytest.mark.parametrize("magnitude", [1.0, 1e-8, 1e8])
def test_single_precision_and_blocks_lose_nothing_that_matters(magnitude):
    operators = Operators(blob(3))
    spectrum = operators.lbo(301)
    filters = mexican_hat_filters(spectrum.evals[1:], 32, spectrum.evals[-1])[:, [24, 6]]
    energies = np.random.default_rng(0).uniform(size=(642, 3)) * [1, 1e-60, 1e60]
    evecs = spectrum.evecs[:, 1:]
    expected = []
    for response in filters.T:
        squares = ((evecs * response) @ evecs.T) ** 2
        expected.append((squares / np.linalg.norm(squares, axis=0)).T @ energies)
    np.testing.assert_allclose(aggregate(magnitude * evecs, filters, energies), np.hstack(expected), rtol=1e-5)


def test_a_faint_filter_gathers_as_well_as_a_strong_one():
    rng = np.random.default_rng(0)
    evecs, response, energies = rng.normal(size=(300, 5)), rng.uniform(size=(5, 1)), rng.uniform(size=(300, 2))
    np.testing.assert_allclose(
        aggregate(evecs, 1e-30 * response, energies), aggregate(evecs, response, energies), rtol=1e-5
    )


def test_finer_sampling_keeps_the_size_of_the_values():
    coarse, fine = (WEDS(k=40)(blob(subdivisions)).values for subdivisions in (3, 4))
    shared = fine[: len(coarse)]  # subdivision keeps the old vertices first
    change = np.linalg.norm(shared - coarse, axis=0) / np.linalg.norm(coarse, axis=0)
    assert np.median(change) < 0.1


def test_it_has_no_unit():
    mesh = blob(2)
    raw = WEDS(k=30)(Operators(Mesh(3.0 * mesh.vertices, mesh.faces), unit_area=False)).values
    assert_close(raw, WEDS(k=30)(mesh).values)


def test_constant_modes_of_every_component_are_left_out():
    one = sphere(1)
    twins = Mesh(np.concatenate([one.vertices, one.vertices + 5]), np.concatenate([one.faces, one.faces + 42]))
    values = WEDS(k=31)(twins).values
    assert np.isfinite(values).all()
    np.testing.assert_allclose(values[:42], values[42:], rtol=1e-4, atol=1e-4 * values.max())


@pytest.mark.parametrize("wrong", [{"k": 1}, {"levels": 0}, {"n_filters": 5}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        WEDS(**wrong)
