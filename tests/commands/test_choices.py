from __future__ import annotations

import pytest

from csm.commands.choices import _OF_ALL_DATA, NAMES, config_folder, options_of
from csm.commands.groups import GROUPS, data_configs


@pytest.mark.parametrize("group", GROUPS)
def test_the_names_of_a_group_are_those_of_its_configurations(group):
    assert [*NAMES] == [*GROUPS]
    assert list(NAMES[group]()) == list(GROUPS[group]())
    assert options_of(group) == list(GROUPS[group]())


def test_groups_of_files_have_the_names_of_the_files():
    assert options_of("optimizer") == ["adam"]
    assert {f"{name}.yaml" for name in options_of("experiment")} == {
        path.name for path in (config_folder() / "experiment").iterdir()
    }
    assert options_of("nothing") == []


def test_settings_of_all_data_are_those_that_every_set_has():
    every = set.intersection(*(set(node) for node in data_configs().values()))
    assert set(_OF_ALL_DATA) <= every
    assert every - set(_OF_ALL_DATA) <= {"_target_", "split"}
