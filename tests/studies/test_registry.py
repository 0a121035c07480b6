from __future__ import annotations

import inspect
from dataclasses import replace

import pytest

from csm.errors import ConfigError
from csm.studies import registry
from csm.studies.registry import STUDIES, listing, study


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_takes_a_context_and_options_by_name(name):
    first, *options = inspect.signature(study(name).load()).parameters.values()
    assert first.name == "context"
    assert {option.kind for option in options} == {inspect.Parameter.KEYWORD_ONLY}


def test_a_module_that_is_missing_disturbs_no_other_study(monkeypatch):
    broken = replace(STUDIES["table1"], module="csm.studies.nothing")
    monkeypatch.setattr(registry, "STUDIES", {**STUDIES, "broken": broken})
    assert callable(study("table1").load())
    with pytest.raises(ModuleNotFoundError):
        study("broken").load()


def test_an_unknown_study_is_refused_with_those_that_there_are():
    with pytest.raises(ConfigError, match="table1, table2, table6, figure2"):
        study("table9")


def test_the_listing_names_all():
    assert all(name in listing() and entry.purpose in listing() for name, entry in STUDIES.items())
