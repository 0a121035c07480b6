"""Refiners by name."""

from __future__ import annotations

import pytest

from csm.errors import ConfigError
from csm.matching.nearest import Nearest
from csm.matching.refinement import REFINERS, Refined, Refiner, refiner
from csm.matching.refinement.joint import Joint
from csm.matching.refinement.registry import refined


@pytest.mark.parametrize("name", REFINERS)
def test_each_is_a_refiner_of_its_name_and_can_be_a_key(name):
    found = refiner(name)
    assert isinstance(found, Refiner)
    assert found.name == name
    assert hash(found) == hash(refiner(name))
    assert found.parameters()


def test_a_refiner_stays_and_none_is_none():
    mine = Joint(weight=0.25)
    assert refiner(mine) is mine
    assert refiner(None) is None
    assert refiner("none") is None


@pytest.mark.parametrize("wrong", ["zoomin", 3, ["joint"]])
def test_what_is_unknown_is_refused_with_what_there_is(wrong):
    with pytest.raises(ConfigError, match="wanted none, multistart, trusting, joint, zoomout, bijective or icp"):
        refiner(wrong)


def test_every_matcher_is_followed_by_every_refiner():
    made = refined([Nearest()], ["none", "joint", Joint(weight=0.25)])
    assert made == [Nearest(), Refined(Nearest(), Joint()), Refined(Nearest(), Joint(weight=0.25))]
    with pytest.raises(ConfigError, match="wanted one or more of none, multistart"):
        refined([Nearest()], [])
