from __future__ import annotations

import numpy as np
import pytest

from csm.data.shapes import InMemory, Shape
from csm.data.store import Store
from csm.errors import DataError
from csm.evaluation.memory import Memory, Recent
from csm.mesh.correspondence import Direction, PointMap
from tests.evaluation.toys import N, Positions, shapes


def test_what_was_used_last_stays_as_far_as_it_fits():
    made: list[str] = []
    recent = Recent(lambda name: made.append(name) or name.upper(), lambda _: 10, 35)
    assert [recent(name) for name in "abcabc"] == list("ABCABC")
    assert made == list("abc")
    assert [recent(name) for name in "adab"] == list("ADAB")
    assert made == list("abcdb"), "b was used longest ago when d came"


def test_something_too_large_is_kept_while_it_is_the_last():
    made: list[str] = []
    recent = Recent(lambda name: made.append(name) or name, lambda _: 10, 5)
    assert [recent(name) for name in "aabba"] == list("aabba")
    assert made == list("aba")


def test_what_fails_is_not_remembered():
    answers = iter([1, 2])
    recent = Recent(lambda: 1 // 0 if next(answers) == 1 else "well", lambda _: 1, 9)
    with pytest.raises(ZeroDivisionError):
        recent()
    assert recent() == "well"


def test_shapes_have_maps_from_the_template_and_descriptions_are_made_of_them(tmp_path):
    given = shapes()[1]
    back = PointMap(np.arange(N), Direction.SHAPE_TO_TEMPLATE, N)
    items = InMemory([Shape(given.mesh, back, given.mirror)])
    memory = Memory(items, {"positions": Positions()}, Store(tmp_path), "cpu")
    assert memory.shape("s1").truth.direction is Direction.TEMPLATE_TO_SHAPE
    assert memory.shape("s1").mirror is given.mirror
    assert memory.described("positions", "s1").mesh is given.mesh
    assert memory.described("positions", "s1") is memory.described("positions", "s1")
    with pytest.raises(DataError, match="no shape 's9'"):
        memory.shape("s9")
