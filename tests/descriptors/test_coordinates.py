from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import Coordinates
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, assert_close, rigid_motion
from tests.shapes import blob, rotation


def test_positions_are_centred_and_at_unit_area():
    operators = Operators(blob(2))
    values = Coordinates()(blob(2)).values
    np.testing.assert_allclose(operators.mass @ values, 0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(values, axis=0), np.ptp(blob(2).vertices, axis=0) / np.sqrt(blob(2).area))


def test_the_centre_does_not_follow_the_sampling():
    coarse, fine = (Coordinates()(blob(level)).values for level in (3, 4))
    assert np.abs(fine[: len(coarse)] - coarse).max() < 0.02
    assert np.abs(coarse.mean(0)).max() > 0.02, "the mean over the vertices would differ"


@pytest.mark.parametrize("check", [check for check in CHECKS if check is not rigid_motion])
def test_invariance(check):
    check(Coordinates())


def test_it_moves_along_with_rotations_only():
    turned = replace(blob(2), vertices=blob(2).vertices @ rotation(5).T + np.array([1.0, 2.0, 3.0]))
    assert_close(Coordinates()(turned).values, Coordinates()(blob(2)).values @ rotation(5).T)
    with pytest.raises(AssertionError):
        rigid_motion(Coordinates())
