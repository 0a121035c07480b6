from __future__ import annotations

from csm.matching.parts import likely_part
from csm.mesh.perturb import without_part
from tests.shapes import blob, plane


def test_the_open_one_of_two_is_probably_the_part():
    whole = blob(3)
    part = without_part(whole, 0, 0.3).mesh
    assert likely_part(part, whole) == 0
    assert likely_part(whole, part) == 1


def test_two_that_are_closed_or_open_are_no_part_and_whole():
    assert likely_part(blob(2), blob(2)) is None
    assert likely_part(plane(), plane()) is None
    nearly_closed = without_part(blob(4), 0, 0.0005).mesh
    assert likely_part(nearly_closed, blob(2)) is None
