"""The benchmark of matching, with competitors that cost nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.reproduction import competitors, peers
from csm.reproduction.competitors import COMPETITORS
from csm.reproduction.peers import Peers
from csm.reproduction.study import Context, Findings, write_findings
from tests.reproduction.toys import Toys, toy_context


@pytest.fixture
def context(tmp_path) -> Context:
    return toy_context(tmp_path)


@pytest.fixture
def calls(monkeypatch) -> list[tuple[str, int]]:
    """Toys for humans, and competitors that give the truth, or for pyFM a far vertex, at set costs."""
    calls: list[tuple[str, int]] = []
    monkeypatch.setattr(peers, "humans_set", lambda *_: Toys())
    everywhere = {name: replace(found, package="csm") for name, found in COMPETITORS.items()}
    monkeypatch.setattr(peers, "COMPETITORS", everywhere)

    def fake(name, source, target):
        calls.append((name, len(source[0])))
        n = len(source[0])
        indices = np.arange(n) if name != "pyfm" else np.full(n, int(target[0][:, 0].argmax()))
        seconds = {"acd": 2.0, "pyfm": 3.0}.get(name, 1.0) * (1 + (len(calls) % 2) * 1e-9)
        found = {"wall": 2 * seconds, "cpu": seconds, "before": 90.0, "peak": 100.0 + len(name)}
        return {"indices": indices, **{key: np.asarray(value) for key, value in found.items()}}

    monkeypatch.setattr(peers, "measure", fake)
    return calls


def run(context: Context, **options: object) -> Findings:
    return Peers("benchmark_peers", **{"points": 60, "exact_points": 20, "sample": 3, **options}).run(context)


def test_rows_have_errors_shares_seconds_and_memory(context, calls):
    findings = run(context, methods=("acd", "pyfm"))
    one, two = findings.rows
    assert (one["set"], one["method"]) == ("built-in humans", "csm: acd, nearest")
    assert (one["mean error"], one["pairs below 30"], one["MB"]) == (0.0, "100 %", 103)
    assert one["seconds"] == pytest.approx(2)
    assert two["ratio"] == pytest.approx(1.5)
    assert two["pairs below 30"] == "0 %"
    assert 200 < two["mean error"] < 1000
    assert two["mean error"] == pytest.approx(1000 * np.mean([p["error"] for p in two["pairs"]]), abs=0.1)
    assert [p["pair"] for p in one["pairs"]] == [p["pair"] for p in two["pairs"]]
    assert len(one["pairs"]) == 3
    assert Image.open(findings.pictures[0]).width > 500
    assert "3 of built-in humans" in findings.notes[0]


def test_methods_take_turns_pair_by_pair_as_often_as_asked(context, calls):
    run(context, methods=("acd", "pyfm"), sample=2, repeats=2)
    assert [name for name, _ in calls] == ["acd", "pyfm"] * 4


def test_the_same_seed_draws_the_same_pairs(context, calls):
    pairs = [
        [p["pair"] for p in run(replace(context, seed=seed), methods=("acd",)).rows[0]["pairs"]] for seed in (1, 1, 2)
    ]
    assert pairs[0] == pairs[1] != pairs[2]


def test_what_fails_is_left_out_of_its_row_and_noted(context, calls, monkeypatch):
    honest = peers.measure

    def fails(name, *surfaces):
        if name == "pyfm" and len(calls) < 2:
            raise ZeroDivisionError("no")
        return honest(name, *surfaces)

    monkeypatch.setattr(peers, "measure", fails)
    findings = run(context, methods=("acd", "pyfm"))
    assert findings.rows[1]["failures"] == 1
    assert findings.rows[1]["pairs"][0]["failed"] == "ZeroDivisionError: no"
    assert findings.rows[0]["failures"] == 0
    assert "pyFM, defaults on 1 of built-in humans" in findings.notes[-1]


def test_a_method_that_never_works_has_an_empty_row(context, calls, monkeypatch):
    honest = peers.measure
    monkeypatch.setattr(peers, "measure", lambda name, *s: honest(name, *s) if name == "acd" else 1 / 0)
    findings = run(context, methods=("acd", "pyfm"))
    assert findings.rows[1]["mean error"] is None
    assert "| pyFM, defaults |  |" in findings.markdown()


def test_without_the_others_csm_is_measured_alone_and_one_sentence_says_so(context, calls, monkeypatch, caplog):
    gone = {
        n: replace(found, package="no_such_package" if n.startswith("pyfm") else "csm")
        for n, found in COMPETITORS.items()
    }
    monkeypatch.setattr(peers, "COMPETITORS", gone)
    findings = run(context, methods=("acd", "pyfm", "pyfm_readme"))
    assert [row["name"] for row in findings.rows] == ["acd"]
    assert [note for note in findings.notes if "not installed" in note] == [findings.notes[-1]]
    assert 'pip install "csm-correspondence[peers]"' in caplog.text
    with pytest.raises(ConfigError, match="none of the methods can run"):
        run(context, methods=("pyfm",))


def test_the_files_name_no_place_of_the_machine(context, calls):
    findings = run(context, methods=("acd",))
    written = write_findings(findings, context.out, provenance(["csm"]), 1.0)
    assert not any(str(context.out.parent) in path.read_text() for path in written)


@pytest.mark.parametrize(
    "wrong", [{"sets": ("nothing",)}, {"methods": ("nothing",)}, {"methods": ()}, {"sample": 0}, {"repeats": 0}]
)
def test_wrong_options_are_refused(context, wrong):
    with pytest.raises(ConfigError, match="wanted sets out of faust, shrec19, tosca, methods out of acd"):
        run(context, **wrong)


def test_every_default_is_a_competitor():
    assert set(Peers("x").methods) <= set(competitors.COMPETITORS)
