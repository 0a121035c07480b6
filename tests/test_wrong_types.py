"""The names of daily work answer objects of a wrong type with a sentence on what is wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import csm
from csm.errors import CsmError
from tests.shapes import blob

ODD = [None, 3, np.zeros((4, 3)), [1, 2], {"a": 1}, trimesh.Scene([trimesh.creation.box()] * 2)]


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: type(odd).__name__)
@pytest.mark.parametrize(
    "call",
    [
        csm.read_mesh,
        csm.read_polygons,
        csm.check,
        csm.clean,
        csm.Operators,
        csm.geodesics,
        csm.load_model,
        csm.ACD(),
        lambda odd: csm.match(odd, blob(1), "gps"),
        lambda odd: csm.match(blob(1), blob(1), odd),
        lambda odd: csm.match(blob(1), blob(1), "gps", odd),
        lambda odd: csm.match(blob(1), blob(1), "gps", clean=odd),
    ],
    ids=[
        "read",
        "polygons",
        "check",
        "clean",
        "operators",
        "geodesics",
        "load",
        "acd",
        "mesh",
        "method",
        "rule",
        "how",
    ],
)
def test_a_wrong_type_is_named(call, odd):
    with pytest.raises(CsmError) as refused:
        call(odd)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("path", ["gone.off", Path("gone.off")])
def test_a_path_is_taken_for_one(path):
    for call in (csm.read_mesh, csm.read_polygons):
        with pytest.raises(CsmError, match=r"gone\.off: there is no such file"):
            call(path)
