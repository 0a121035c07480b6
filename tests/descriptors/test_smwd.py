from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.asmwd import ASMWD
from csm.descriptors.smwd import SMWD
from csm.errors import ConfigError
from csm.operators import Operators
from csm.operators.filters import mexican_hat_filters
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.shapes import blob

VARIANTS = ("meyer", "mexican")


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check, variant):
    check(SMWD(variant, k=20, n_filters=4))


@pytest.mark.parametrize("variant", VARIANTS)
def test_mirror_image_changes_nothing(variant):
    descriptor, mesh = SMWD(variant, k=40), blob(3)
    assert_close(descriptor(mirrored(mesh)).values, descriptor(mesh).values)


def test_meyer_is_the_isotropic_case_of_the_anisotropic_descriptor():
    operators = Operators(blob(2))
    isotropic = ASMWD(alpha=0.0, angles=1, k=40)
    np.testing.assert_array_equal(SMWD(k=40)(operators).values, isotropic(operators).values)
    assert SMWD()(operators).values.shape[1] == 10


def test_mexican_components_are_the_wavelets_at_their_own_centres():
    operators = Operators(blob(2))
    spectrum = operators.lbo(40)
    filters = mexican_hat_filters(spectrum.evals, 10, spectrum.evals[-1])
    values = SMWD("mexican", k=40, normalise=False)(operators).values
    impulses = np.diag(1 / spectrum.mass)
    for s in range(10):
        wavelets = spectrum.evecs * filters[:, s] @ spectrum.evecs.T * spectrum.mass @ impulses
        np.testing.assert_allclose(values[:, s], np.diag(wavelets), rtol=1e-9)


@pytest.mark.parametrize("wrong", [{"variant": "haar"}, {"k": 1}, {"n_filters": 1}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match=r"wanted|one of"):
        SMWD(**wrong)
