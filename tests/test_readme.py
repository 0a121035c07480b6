from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from csm.commands.main import COMMANDS
from tests.readme_tables import BLOCK, ROOT, with_tables

README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND_LINES = [
    line.split("#")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    for line in block.splitlines()
    if line.startswith("csm ")
]


def test_every_table_is_what_its_json_says():
    assert BLOCK.search(README)
    assert with_tables(README) == README


def test_every_link_to_a_file_leads_to_one():
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_every_command_names_options_that_exist(line):
    _, command, *arguments = shlex.split(line)
    assert command in COMMANDS
    config = (ROOT / f"conf/{command}.yaml").read_text()
    for argument in arguments:
        key, _, value = argument.partition("=")
        group = ROOT / "conf" / key
        if group.is_dir():
            assert (group / f"{value}.yaml").exists(), argument
        elif key.isidentifier() and key != "checkpoint":
            assert f"{key}:" in config, argument


def test_the_scripts_of_the_data_sets_are_there():
    named = set(re.findall(r"`?([a-z_0-9]+\.py)`", README))
    assert {"scape.py", "tosca.py"} <= named
    assert all(list(Path(ROOT).glob(f"*/{name}")) for name in named)
