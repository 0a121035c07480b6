from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.add import ADD
from csm.errors import ConfigError, NumericalError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.descriptors.test_geovec import bump
from tests.shapes import blob, sphere


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(ADD(angles=3, k=20, n_splines=4))


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_against_a_loop_over_angles_splines_and_pairs(shift):
    operators = Operators(blob(2))
    raw = np.empty((operators.mesh.n_vertices, 0))
    for j in range(3):
        spectrum = operators.albo(6.0, np.pi * j / 3, 25)
        knots = spectrum.evals / spectrum.evals[-1] * 4
        for i in range(5):
            total = sum(bump(knots[k] - i + shift) * spectrum.evecs[:, k] ** 2 for k in range(25))
            raw = np.column_stack([raw, total])
    scale = np.abs(raw).max()
    descriptor = ADD(6.0, 3, 25, 5, shift, normalise=False)
    np.testing.assert_allclose(descriptor(operators).values, raw, atol=1e-9 * scale)
    unit = raw / np.linalg.norm(raw, axis=1)[:, None]
    np.testing.assert_allclose(ADD(6.0, 3, 25, 5, shift)(operators).values, unit, atol=1e-9)


def test_every_column_has_something_to_say():
    values = ADD(angles=3)(blob(3)).values
    assert (np.ptp(values, axis=0) > 1e-4).all()


@pytest.mark.parametrize("angles", [8, 5])
def test_mirror_image_reverses_the_angles(angles):
    descriptor, mesh = ADD(angles=angles, k=20, n_splines=4), blob(3)
    original, image = (descriptor(m).values.reshape(mesh.n_vertices, angles, -1) for m in (mesh, mirrored(mesh)))
    assert_close(image, original[:, -np.arange(angles) % angles])
    assert np.abs(image - original).max() > 1e-3


@pytest.mark.parametrize("wrong", [{"alpha": -1}, {"angles": 0}, {"k": 1}, {"n_splines": 1}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        ADD(**wrong)


def test_isotropic_is_one_block():
    with pytest.raises(ConfigError, match="angles=1"):
        ADD(alpha=0.0)
    assert ADD(alpha=0.0, angles=1, k=10)(blob(2)).values.shape == (162, 16)


def test_as_many_pairs_as_components_is_an_error():
    one = sphere(1)
    twins = Mesh(np.concatenate([one.vertices, one.vertices + 5]), np.concatenate([one.faces, one.faces + 42]))
    with pytest.raises(NumericalError, match="one per component"):
        ADD(k=2)(twins)
