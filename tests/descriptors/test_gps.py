from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors.gps import GPS
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, mirrored
from tests.shapes import blob


def test_against_a_loop():
    operators = Operators(blob(2))
    features = GPS(k=5)(operators)
    spectrum = operators.lbo(6)
    for column in range(5):
        for vertex in range(operators.mesh.n_vertices):
            expected = abs(spectrum.evecs[vertex, column + 1]) / np.sqrt(spectrum.evals[column + 1])
            assert features.values[vertex, column] == pytest.approx(expected)
    assert features.columns == ("phi_2", "phi_3", "phi_4", "phi_5", "phi_6")


@pytest.mark.parametrize("check", CHECKS)
def test_invariance(check):
    check(GPS())


def test_mirror_and_scale_change_nothing_whatever_the_unit():
    before = GPS()(blob(3)).values
    changed = mirrored(replace(blob(3), vertices=3.0 * blob(3).vertices))
    for shape in (changed, Operators(changed, unit_area=False)):
        np.testing.assert_allclose(GPS()(shape).values, before, atol=1e-6 * before.max())


def test_signs_of_eigenvectors_matter_only_without_absolute_values(monkeypatch):
    signed, absolute = GPS(absolute=False), GPS()
    before = [descriptor(blob(2)).values for descriptor in (signed, absolute)]
    honest = Operators._spectrum
    monkeypatch.setattr(Operators, "_spectrum", lambda self, *a: replace(found := honest(self, *a), evecs=-found.evecs))
    np.testing.assert_array_equal(signed(blob(2)).values, -before[0])
    np.testing.assert_array_equal(absolute(blob(2)).values, before[1])


def test_every_component_has_its_constant_function():
    one = blob(2)
    aside = one.vertices + np.array([10.0, 0.0, 0.0])
    both = Mesh(np.vstack([one.vertices, aside]), np.vstack([one.faces, one.faces + one.n_vertices]))
    values = GPS(k=8)(both).values
    assert values.shape == (2 * 162, 8)
    assert values.max() < 10 * GPS(k=8)(blob(2)).values.max()


def test_settings_out_of_range_are_refused():
    with pytest.raises(ConfigError, match="wanted"):
        GPS(k=0)
