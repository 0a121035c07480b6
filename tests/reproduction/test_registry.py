from __future__ import annotations

from dataclasses import fields, replace

import pytest

from csm.errors import ConfigError
from csm.reproduction import registry
from csm.reproduction.registry import STUDIES, entry, listing, make_study, options_of
from csm.reproduction.study import Study


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_can_be_made_from_its_own_options(name):
    study = make_study(name, options_of(name))
    assert isinstance(study, Study)
    assert study == make_study(name, {})
    assert study.name == name


@pytest.mark.parametrize("name", STUDIES)
def test_every_option_of_a_study_is_documented(name):
    found = entry(name).load()
    texts = [line.strip() for each in found.__mro__ for line in (each.__doc__ or "").splitlines()]
    documented = {word for line in texts for word in line.split(", ")}
    options = {f.name for f in fields(found)} - {"name"}
    assert options <= documented, options - documented


def test_a_module_that_is_missing_disturbs_no_other_study(monkeypatch):
    broken = replace(STUDIES["table1"], place="nothing:Nothing")
    monkeypatch.setattr(registry, "STUDIES", {**STUDIES, "broken": broken})
    assert callable(entry("table1").load())
    with pytest.raises(ModuleNotFoundError):
        entry("broken").load()


def test_an_unknown_study_is_refused_with_those_that_there_are():
    with pytest.raises(ConfigError, match="table1, table2, table4, table5, table6, figure2"):
        entry("table9")
    with pytest.raises(ConfigError, match="no study 'table9'"):
        make_study("table9", {})


def test_an_unknown_option_is_refused_with_those_that_there_are():
    with pytest.raises(ConfigError, match="figure2 has no option kk; it has source, alpha, degrees, k"):
        make_study("figure2", {"kk": 3})
    with pytest.raises(ConfigError, match="table4 has no option picture; it has overrides"):
        make_study("table4", {"picture": "curves"})


def test_lists_of_configurations_become_options():
    assert make_study("table2", {"sizes": [3, 4]}).sizes == (3, 4)


def test_the_listing_names_all():
    lines = listing().splitlines()
    assert [line.split()[0] for line in lines] == list(STUDIES)
    assert all(line.endswith(" " + found.purpose) for line, found in zip(lines, STUDIES.values(), strict=True))
