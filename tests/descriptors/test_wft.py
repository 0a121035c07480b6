from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.wft import WFT
from csm.descriptors.windowed import surface_functions, windowed_energies
from csm.errors import ConfigError
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.shapes import blob


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(WFT(k=40, normalise="area"))


def test_mirror_image_changes_nothing():
    descriptor, mesh = WFT(k=40), blob(3)
    assert_close(descriptor(mirrored(mesh)).values, descriptor(mesh).values)


def test_one_column_per_width_and_function_in_the_order_of_the_names():
    operators = Operators(blob(2))
    names = ("geovec30", "wks80", "shape_index")
    features = WFT(k=40, functions=names)(operators)
    assert features.values.shape[1] == 15
    for tau in (0.001, 0.1):
        for name in names:
            f = surface_functions(operators, [name], 40, spline_shift=0.0, index_sweeps=10)
            energy = windowed_energies(operators.lbo(40), f, [tau])[:, 0, 0]
            column = features.values[:, features.columns.index(f"tau={tau:g} {name}")]
            np.testing.assert_allclose(column, energy / np.linalg.norm(energy), rtol=1e-9)


def test_only_the_norm_over_the_area_is_the_same_at_another_resolution():
    names = ("constant", "fiedler", "hks80")
    ratios = {}
    for norm in ("area", "vertices"):
        descriptor = WFT(k=30, functions=names, normalise=norm)
        coarse, fine = (descriptor(blob(subdivisions)).values for subdivisions in (3, 4))
        ratios[norm] = np.median(fine[: len(coarse)] / coarse, axis=0)  # subdivision keeps the old vertices first
    np.testing.assert_allclose(ratios["area"], 1, atol=0.05)
    np.testing.assert_allclose(ratios["vertices"], 0.5, atol=0.025)


@pytest.mark.parametrize(
    "wrong", [{"k": 1}, {"taus": ()}, {"taus": (0.1, 0.0)}, {"taus": (float("nan"),)}, {"index_sweeps": -1}]
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        WFT(**wrong)


def test_unknown_functions_and_norms_are_refused():
    with pytest.raises(ConfigError, match="no function"):
        WFT(functions=("geovec200",))
    with pytest.raises(ConfigError, match="normalise"):
        WFT(normalise="rows")
