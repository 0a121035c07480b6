from __future__ import annotations

import math
import re
import shlex
import sys
from pathlib import Path

import pytest
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra

from csm.commands import app
from csm.commands.main import main
from csm.commands.schema import require_valid
from tests.readme_tables import BLOCK, PAGES, ROOT, with_tables

README = (ROOT / "README.md").read_text(encoding="utf-8")
MATCHING = (ROOT / "docs/matching.md").read_text(encoding="utf-8")
COMMAND_LINES = dict.fromkeys(
    line.split("#")[0].strip()
    for page in PAGES
    if page.name != "extending.md"  # whose code has to be there: tests/test_extending.py
    for block in re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    for line in block.splitlines()
    if line.startswith("csm ")
)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_table_is_what_its_json_says(page):
    text = page.read_text(encoding="utf-8")
    assert with_tables(text) == text


def test_there_are_tables():
    assert BLOCK.search(README)
    assert BLOCK.search((ROOT / "docs/results.md").read_text(encoding="utf-8"))
    assert BLOCK.search(MATCHING)


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
def test_every_command_line_is_taken_as_it_stands(line, monkeypatch, tmp_path):
    """Run the line, in another folder, up to its jobs: what is typed is parsed, composed and found valid."""
    jobs = []

    def job(run, cfg, *_):
        require_valid(cfg)
        jobs.append(cfg)
        return 0.0  # for Optuna, which asks what came of a job

    monkeypatch.setattr(app, "_job", job)
    if line.startswith("csm match"):  # other commands in this process have made a group of that name, a match has none
        monkeypatch.delitem(ConfigStore.instance().repo, "model", raising=False)
    monkeypatch.chdir(tmp_path)
    tuned = "experiment=tune" in line  # twenty jobs take their time
    monkeypatch.setattr(sys, "argv", [*shlex.split(line), *["hydra.sweeper.n_trials=2"] * tuned])
    GlobalHydra.instance().clear()
    main()
    if tuned:
        assert len(jobs) == 2
        return
    sweep = re.findall(r"=(\S+,\S+)", line) if " -m " in line else []
    assert len(jobs) == math.prod(len(values.split(",")) for values in sweep)


def test_the_scripts_of_the_data_sets_are_there():
    named = set(re.findall(r"`?([a-z_0-9]+\.py)`", README))
    assert {"scape.py", "tosca.py"} <= named
    assert all(list(Path(ROOT).glob(f"*/{name}")) for name in named)
