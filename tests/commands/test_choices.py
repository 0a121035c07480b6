from __future__ import annotations

import pytest

from csm.commands.choices import NAMES, config_folder, options_of
from csm.commands.groups import GROUPS


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
