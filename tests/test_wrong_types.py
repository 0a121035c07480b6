"""The names of daily work answer objects of a wrong type with a sentence on what is wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import csm
from csm.errors import CsmError
from csm.mesh.textured import Textured
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
        csm.match_collection,
        lambda odd: csm.write_mesh("a.off", odd),
        lambda odd: csm.write_textured("a.obj", odd),
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
        "collection",
        "write",
        "textured",
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


def test_a_writer_that_gets_the_path_last_says_so(tmp_path):
    texture = Textured(blob(1), np.zeros((80, 3, 2)), ())
    for write, thing, name in ((csm.write_mesh, blob(1), "Mesh"), (csm.write_textured, texture, "Textured")):
        with pytest.raises(
            CsmError, match=f"got a {name} and a {type(tmp_path).__name__}, the other way round; wanted the path first"
        ):
            write(thing, tmp_path / "a.obj")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("alone", [blob(1), trimesh.creation.box()], ids=["mesh", "trimesh"])
def test_one_mesh_is_no_collection(alone):
    with pytest.raises(CsmError, match=r"wanted a folder, or a list of two or more meshes; got a (Mesh|Trimesh)$"):
        csm.match_collection(alone)
