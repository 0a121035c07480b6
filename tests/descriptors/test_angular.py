from __future__ import annotations

import numpy as np
import pytest

from csm import _progress
from csm.descriptors import ACD, ASMWD, angular
from csm.errors import ConfigError
from csm.operators import Operators
from tests.shapes import blob


@pytest.mark.parametrize("family", [ACD, ASMWD])
def test_angles_are_spread_over_the_half_circle_and_ask_for_their_laplacians(family):
    descriptor = family(alpha=3.0, angles=4, k=5, frame="smooth", smoothing=0.2)
    np.testing.assert_allclose(descriptor.thetas, [0, np.pi / 4, np.pi / 2, 3 * np.pi / 4])
    operators = Operators(blob(2))
    expected = operators.albo(3.0, np.pi / 4, 5, frame="smooth", smoothing=0.2)
    assert descriptor._spectrum(operators, descriptor.thetas[1]) is expected


@pytest.mark.parametrize("family", [ACD, ASMWD])
def test_without_anisotropy_one_angle_is_enough_and_more_are_refused(family):
    operators = Operators(blob(2))
    assert family(alpha=0, angles=1, k=5)._spectrum(operators, 0.0) is operators.lbo(5)
    with pytest.raises(ConfigError, match="set angles=1"):
        family(alpha=0, angles=2)


def test_the_angles_of_a_big_mesh_have_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(_progress, "FIRST", 0.0)
    monkeypatch.setattr(_progress, "SECONDS", 0.0)
    family = ACD(angles=3, k=5, cuts=1)
    family(blob(2))
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(angular, "_SLOW", 100)
    family(blob(2))
    assert "3/3" in capsys.readouterr().err
