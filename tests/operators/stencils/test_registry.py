from __future__ import annotations

import pytest

from csm.operators.stencils import stencil


def test_unknown_stencils_are_named():
    with pytest.raises(ValueError, match="no stencil 'nope'; known are"):
        stencil("nope")
