from __future__ import annotations

import subprocess
import sys

import pytest

import csm


@pytest.mark.parametrize("name", csm.__all__)
def test_every_public_name_is_there(name):
    assert getattr(csm, name).__name__.split(".")[-1] == name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nothing"):
        _ = csm.nothing


def test_operators_and_descriptors_do_not_load_torch():
    code = "import sys, csm, csm.data.prepare; csm.ACD; csm.Operators; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
