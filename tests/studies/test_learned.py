from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.evaluation.report import ResultRow
from csm.studies.learned import curves, dots, findings, sweeps
from tests.evaluation.test_report import row as result_row


@pytest.fixture
def rows(tmp_path) -> list[ResultRow]:
    row = result_row(
        table="table5",
        method="scape_mgcn",
        train="SCAPE_5000",
        test="SCAPE_5000",
        age=0.02,
        age_std=0.001,
        exact_match=0.25,
        seeds=(0, 1),
        epochs=3,
        protocol="some pairs",
    )
    for seed, half in ((0, 0.4), (1, 0.8)):
        file = tmp_path / "scape_mgcn" / f"seed{seed}" / "SCAPE_5000_exact_diameter.cqc.csv"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"threshold,SCAPE_5000\n0,0.1\n0.1,{half}\n0.2,1\n")
    return [row, replace(row, method="scape_mgcn, argmax", age=0.03)]


def test_the_paper_and_the_classifier_stand_beside_ours(rows):
    found = findings("table5", rows)
    (line,) = found.rows
    assert found.columns[:4] == ("method", "5000 paper", "5000 ours", "5000 argmax")
    assert (line["method"], line["seeds"], line["epochs"]) == ("MGCN", "0 1", 3)
    assert (line["5000 paper"], line["5000 ours"], line["5000 argmax"]) == (70, "20.0 ± 1.0", "30.0 ± 1.0")
    assert [kept["age"] for kept in line["rows"]] == [0.02, 0.03]


def test_what_is_not_of_one_cell_is_in_the_order_of_the_tests(rows):
    more = replace(rows[0], test="SCAPE_12500", age=0.05, exact_match=0.1, p95=0.2)
    found = findings("table5", [rows[0], more])
    assert found.columns[1:5] == ("5000 paper", "5000 ours", "12500 paper", "12500 ours")
    assert (found.rows[0]["exact %"], found.rows[0]["95th percentile"]) == ("25 / 10", "- / 200")
    assert "argmax" not in found.notes[0]


def test_every_protocol_says_what_it_is_of(rows):
    mine = replace(rows[0], method="mine", protocol="other pairs")
    first, *protocols = findings("any", [*rows, mine]).notes
    assert "nearest learned descriptor" in first
    assert protocols == [
        "SCAPE_5000 (scape_mgcn, scape_mgcn, argmax): some pairs",
        "SCAPE_5000 (mine): other pairs",
    ]
    assert findings("any", rows).notes[1] == "SCAPE_5000: some pairs"


def test_names_of_sets_are_shortened_by_what_they_share(rows):
    columns = findings("any", [replace(rows[0], train="original", test="refined_10000")]).columns
    assert columns[1:3] == ("refined_10000 paper", "refined_10000 ours")


def test_curves_are_means_over_seeds_with_a_panel_per_test_set(tmp_path, rows, monkeypatch):
    drawn = {}
    monkeypatch.setattr("csm.studies.learned.curve_panels", drawn.update)
    curves(tmp_path, rows[:1])
    assert list(drawn) == ["SCAPE_5000"]
    assert drawn["SCAPE_5000"]["MGCN"].cqc.tolist() == pytest.approx([0.1, 0.6, 1.0])


def test_dots_are_the_mean_errors_in_one_picture(tmp_path, rows, monkeypatch):
    drawn = []
    monkeypatch.setattr("csm.studies.learned.dots_figure", lambda *given: drawn.append(given))
    dots([rows[0], replace(rows[0], method="scape_paper", test="SCAPE_12500")])
    ((names, panels),) = drawn
    assert names == ["MGCN", "CSMCNN"]
    (values,) = panels.values()
    assert values["SCAPE_5000"][0] == pytest.approx(20)
    assert values["SCAPE_12500"][0] != values["SCAPE_12500"][0]  # not measured


def test_a_sweep_has_the_rows_that_are_there_in_the_order_of_their_values(rows):
    ages = {"base": 0.02, "ks_64": 0.03, "ks_16": 0.05, "instance_norm": 0.04}
    filled = [replace(rows[0], method=method, age=age, age_std=None) for method, age in ages.items()]
    varied = {
        "K_s": {128: "base", 64: "ks_64", 16: "ks_16", 256: "not trained"},
        "normalisation": {"batch": "base", "instance": "instance_norm"},
    }
    first, second = sweeps(filled, varied).axes
    assert [text.get_text() for text in first.get_xticklabels()] == ["16", "64", "128"]
    np.testing.assert_allclose(first.get_lines()[0].get_ydata(), [50, 30, 20])
    assert [text.get_text() for text in second.get_xticklabels()] == ["batch", "instance"]
    assert list(second.get_lines()[-1].get_xdata()) == [0]
    assert first.get_ylabel() == "mean error (thousandths\nof the diameter)"
    (only,) = sweeps(filled[1:3], varied).axes
    assert [text.get_text() for text in only.get_xticklabels()] == ["16", "64"]
