from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra

from csm.commands.main import COMMANDS, main
from tests.readme_tables import BLOCK, PAGES, ROOT, with_tables

README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND_LINES = [
    line.split("#")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    for line in block.splitlines()
    if line.startswith("csm ")
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_table_is_what_its_json_says(page):
    text = page.read_text(encoding="utf-8")
    assert with_tables(text) == text


def test_there_are_tables():
    assert BLOCK.search(README)
    assert BLOCK.search((ROOT / "docs/results.md").read_text(encoding="utf-8"))


def test_the_readme_is_a_front_door():
    assert len(README.splitlines()) < 200


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_every_link_to_a_file_leads_to_one(page):
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_json_that_a_page_names_is_there():
    named = {name for page in PAGES for name in re.findall(r"results/\w+\.json", page.read_text(encoding="utf-8"))}
    assert named
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_every_command_composes(line, monkeypatch, capsys):
    """Run the line as it stands up to its configuration, which `--cfg job` prints instead of doing the work."""
    _, command, *arguments = shlex.split(line)
    assert command in COMMANDS
    monkeypatch.setattr("sys.argv", ["csm", command, *(a for a in arguments if a != "-m"), "--cfg", "job"])
    if "-m" in arguments:  # a sweep is composed with the first of its values
        sys.argv[2:] = [re.sub(r"=([^,\[]+),.*", r"=\1", argument) for argument in sys.argv[2:]]
    GlobalHydra.instance().clear()
    main()
    assert "workers:" in capsys.readouterr().out


def test_the_scripts_of_the_data_sets_are_there():
    named = set(re.findall(r"`?([a-z_0-9]+\.py)`", README))
    assert {"scape.py", "tosca.py"} <= named
    assert all(list(Path(ROOT).glob(f"*/{name}")) for name in named)
