from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import ACD, HKS, Stack
from csm.errors import ConfigError
from csm.operators import Operators
from tests.shapes import blob


def test_columns_stand_side_by_side_under_the_names_of_their_parts():
    operators = Operators(blob(2))
    parts = {"a": ACD(angles=3, k=5, order=1), "b": HKS(k=9, n_times=2)}
    features = Stack(parts)(operators)
    alone = [part(operators) for part in parts.values()]
    np.testing.assert_array_equal(features.values, np.hstack([f.values for f in alone]))
    assert features.columns == tuple(f"a {c}" for c in alone[0].columns) + tuple(f"b {c}" for c in alone[1].columns)


def test_an_empty_stack_is_refused():
    with pytest.raises(ConfigError, match="at least one"):
        Stack({})
