from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import Constant
from tests.descriptors.invariances import CHECKS
from tests.shapes import blob


def test_every_vertex_has_a_one():
    features = Constant()(blob(2))
    np.testing.assert_array_equal(features.values, np.ones((162, 1)))


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(Constant())
