from __future__ import annotations

import pytest

from csm.errors import ConfigError
from csm.operators.stencils import STENCILS, stencil
from csm.operators.stencils.edge_splines import EdgeSplines


def test_stencils_are_known_by_their_names():
    assert {each.name: each for each in STENCILS.values()} == STENCILS
    assert stencil("edge_splines", kernel=4) == EdgeSplines(4)


def test_unknown_stencils_and_parameters_are_named():
    with pytest.raises(ConfigError, match="no stencil 'nope'; known are albo"):
        stencil("nope")
    with pytest.raises(ConfigError, match=r"stencil edge_splines: .*'size'"):
        stencil("edge_splines", kernel=4, size=3)
    with pytest.raises(ConfigError, match=r"stencil gradients: .*regularisation"):
        stencil("gradients")
