from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.asmwd import ASMWD
from csm.errors import ConfigError, NumericalError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.filters import meyer_filters
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.shapes import blob, sphere


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(ASMWD(angles=3, k=20, n_filters=4))


def test_against_a_loop_over_angles_filters_and_pairs():
    operators = Operators(blob(2))
    raw = np.empty((operators.mesh.n_vertices, 0))
    for j in range(3):
        spectrum = operators.albo(6.0, np.pi * j / 3, 25)
        filters = meyer_filters(spectrum.evals, 5, spectrum.evals[-1])
        for s in range(5):
            total = sum(filters[k, s] * spectrum.evecs[:, k] ** 2 for k in range(25))
            raw = np.column_stack([raw, total / np.abs(filters[:, s]).sum()])
    np.testing.assert_allclose(ASMWD(6.0, 3, 25, 5, normalise=False)(operators).values, raw, rtol=1e-9)
    unit = raw / np.linalg.norm(raw, axis=1)[:, None]
    np.testing.assert_allclose(ASMWD(6.0, 3, 25, 5)(operators).values, unit, rtol=1e-9)


def test_columns_integrate_to_one_before_rows_are_scaled():
    """A filter of unit sum is a weighted mean of squared eigenfunctions, each of unit integral."""
    operators = Operators(blob(3))
    values = ASMWD(angles=3, k=30, n_filters=4, normalise=False)(operators).values
    np.testing.assert_allclose(operators.mass @ values, 1, rtol=1e-9)


def test_low_pass_sees_the_constant_mode_only_at_the_defaults():
    values = ASMWD(alpha=0.0, angles=1, normalise=False)(blob(3)).values
    np.testing.assert_allclose(values[:, 0], 1, rtol=1e-7)
    assert np.ptp(values[:, -1]) > 0.1


@pytest.mark.parametrize("angles", [8, 5])
def test_mirror_image_reverses_the_angles(angles):
    descriptor, mesh = ASMWD(angles=angles, k=20, n_filters=4), blob(3)
    original, image = (descriptor(m).values.reshape(mesh.n_vertices, angles, -1) for m in (mesh, mirrored(mesh)))
    assert_close(image, original[:, -np.arange(angles) % angles])
    assert np.abs(image - original).max() > 1e-3


@pytest.mark.parametrize("wrong", [{"alpha": -1}, {"angles": 0}, {"k": 1}, {"n_filters": 1}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        ASMWD(**wrong)


def test_isotropic_is_one_block():
    with pytest.raises(ConfigError, match="angles=1"):
        ASMWD(alpha=0.0)


def test_as_many_pairs_as_components_is_an_error():
    one = sphere(1)
    twins = Mesh(np.concatenate([one.vertices, one.vertices + 5]), np.concatenate([one.faces, one.faces + 42]))
    with pytest.raises(NumericalError, match="one per component"):
        ASMWD(k=2)(twins)
