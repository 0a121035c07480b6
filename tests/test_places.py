from __future__ import annotations

import pytest

from csm._places import load


def test_a_place_is_a_module_and_a_name_in_it():
    assert load("csm.descriptors.acd:ACD.paper")().order == 6


@pytest.mark.parametrize(("place", "error"), [("csm.nothing:x", ImportError), ("csm.errors:Nothing", AttributeError)])
def test_a_wrong_place_says_what_is_missing(place, error):
    with pytest.raises(error, match=r"[Nn]othing"):
        load(place)
