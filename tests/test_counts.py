from __future__ import annotations

import re

import numpy as np
import pytest

import csm
from csm._counts import counted
from csm.errors import CsmError
from csm.mesh.clean import clean
from csm.mesh.debris import body_of
from csm.mesh.io.raw import unread
from csm.mesh.shape import Mesh
from tests.shapes import blob


@pytest.mark.parametrize(
    ("one", "many"),
    [
        ("shape", "shapes"),
        ("vertex", "vertices"),
        ("mesh file", "mesh files"),
        ("mesh", "meshes"),
        ("entry", "entries"),
    ],
)
def test_one_is_singular_and_all_other_numbers_are_plural(one, many):
    assert [counted(n, one) for n in (0, 1, 2)] == [f"0 {many}", f"1 {one}", f"2 {many}"]


def test_a_phrase_has_its_own_plural():
    assert counted(1, "face has", "faces have") == "1 face has"
    assert counted(np.int64(3), "face has", "faces have") == "3 faces have"


def test_what_follows_a_file_is_told_in_the_right_number():
    assert unread(1, "byte", "its end") == "1 byte follows its end; it was not read"
    assert unread(2, "byte", "its end") == "2 bytes follow its end; they were not read"


def test_messages_on_one_thing_speak_of_one_thing():
    mesh = blob(1)
    lonely = Mesh(np.vstack([mesh.vertices, [[0.0, 0, 0]]]), mesh.faces, "lonely")
    triangle = Mesh(np.eye(3), np.array([[0, 1, 2]]), "t")
    said = [clean(lonely).text, body_of(lonely).note, repr(triangle)]
    with pytest.raises(CsmError) as refused:
        csm.match_collection([mesh])
    said.append(str(refused.value))
    assert [s for s in said if re.search(r"\b1 (vertices|faces|shapes)", s)] == []
    assert all(re.search(r"\b1 (vertex|face|shape)\b", s) for s in said)
