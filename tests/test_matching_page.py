"""The page on matching: it names what there is, its code runs, and its table is of a run that names no place."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from csm.matching.refinement import REFINERS
from csm.reproduction.competitors import COMPETITORS
from csm.reproduction.peers import Peers

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "matching.md").read_text(encoding="utf-8")
RESULT = ROOT / "results" / "benchmark_peers.json"


def test_every_refiner_has_a_row():
    assert re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE) == ["none", *REFINERS]


def test_every_setting_that_it_names_is_there():
    named = re.findall(r"`((?:pyfm|geomfum)_\w+)`", PAGE)
    assert named
    assert set(named) <= set(COMPETITORS)


@pytest.mark.long
def test_its_code_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "store"))
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(block, "matching.md", "exec"), {})
    said = capsys.readouterr().out
    assert "trustworthy partner" in said
    assert "the best of 65 starts" in said


def test_the_result_has_every_method_on_the_same_pairs_and_no_place_of_a_machine():
    text = RESULT.read_text(encoding="utf-8")
    assert not re.search(r"/tmp|/home|/work|/root|/Users", text)
    kept = json.loads(text)
    pairs: dict[str, list[list[list[str]]]] = {}
    for row in kept["rows"]:
        pairs.setdefault(row["set"], []).append([of["pair"] for of in row["pairs"]])
    for of_set in pairs.values():
        assert len(of_set) == len(Peers("benchmark_peers").methods)
        assert all(each == of_set[0] for each in of_set)


def test_the_numbers_of_the_table_follow_from_the_pairs():
    for row in json.loads(RESULT.read_text(encoding="utf-8"))["rows"]:
        errors = [of["error"] for of in row["pairs"] if "error" in of]
        assert row["mean error"] == pytest.approx(1000 * sum(errors) / len(errors), abs=0.051)
        good = 100 * sum(error < 0.03 for error in errors) / len(errors)
        assert row["pairs below 30"] == f"{good:.0f} %"
