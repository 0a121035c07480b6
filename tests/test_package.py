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
    code = "import sys, csm, csm.data.prepare; csm.ACD; csm.Operators; csm.find_set; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_matching_and_evaluation_do_not_load_lightning_or_hydra():
    code = (
        "import sys, csm; csm.match; csm.evaluate; csm.preset; csm.load_humans; "
        "sys.exit(bool({'lightning', 'hydra'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_exactly_the_public_names_are_listed():
    import csm.mesh.check

    assert [name for name in dir(csm) if not name.startswith("__")] == sorted(csm.__all__)
    assert {"__version__", "__doc__", "__all__"} <= {*dir(csm)}
