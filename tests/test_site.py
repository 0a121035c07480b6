"""The pages of the site that are made from the code, and that the whole builds."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from types import ModuleType

import pytest

from csm.commands.choices import options_of
from csm.commands.main import COMMANDS
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    """The module that makes pages, which lies beside them."""
    spec = importlib.util.spec_from_file_location("pages", ROOT / "docs" / "hooks" / "pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_command_and_every_choice_is_there(pages):
    commands, choices = pages.commands_page(), pages.choices_page()
    assert re.findall(r"^## csm ([\w-]+)$", commands, re.MULTILINE) == list(COMMANDS)
    assert "| `checkpoint` | `null` |" in commands
    for group in ("descriptor", "model", "data", "experiment", "recipe"):
        section = choices.partition(f"## {group}\n")[2].partition("\n## ")[0]
        assert re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE) == options_of(group)
    assert "| `own` | csm's own network: CSMCNN with two bands" in choices


def test_every_page_of_the_navigation_is_written_or_made(pages):
    named = re.findall(r": ([\w/]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
    made, written = pages.made_pages(), {path.name for path in (ROOT / "docs").glob("*.md")}
    assert len(named) == len(set(named))
    assert set(named) == made.keys() | written


def test_the_front_page_leads_to_pages_of_the_site(pages):
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)\)", pages.front_page())
    known = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*")} | {"contributing.md"}
    assert links
    assert [link for link in links if link not in known] == []


def test_data_sets_are_listed_where_the_page_asks_for_them(pages):
    text = pages.on_page_markdown((ROOT / "docs" / "data.md").read_text(encoding="utf-8"))
    assert "<!-- layouts -->\n" in text
    assert "| MPI-FAUST | MPI-FAUST.zip from <http://faust.is.tue.mpg.de> (registration" in text


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("mkdocs") is None, reason='needs pip install "csm-correspondence[docs]"')
def test_the_site_builds_without_a_warning(tmp_path):
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    done = subprocess.run(
        build, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "reference" / "matching" / "index.html").is_file()
