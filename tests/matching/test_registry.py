from __future__ import annotations

import pytest

from csm.errors import ConfigError
from csm.matching.classifier import Argmax
from csm.matching.nearest import Nearest
from csm.matching.registry import MATCHERS, matcher, matchers


@pytest.mark.parametrize("name", MATCHERS)
def test_every_matcher_has_defaults_and_its_name(name):
    assert matcher(name).name == name
    assert matcher(name) == MATCHERS[name]()


def test_matchers_are_taken_as_they_are_or_by_name():
    rule = Nearest()
    assert matcher(rule) is rule
    assert matchers(["argmax", rule]) == [Argmax(), rule]


def test_what_there_is_not_is_refused():
    with pytest.raises(ConfigError, match=r"matching='vote'; wanted nearest or argmax"):
        matcher("vote")
    with pytest.raises(ConfigError, match="wanted one or more of nearest, argmax"):
        matchers([])
