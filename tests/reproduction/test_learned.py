from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.evaluation.report import ResultRow
from csm.reproduction.learned import Learned, curves, dots, notes, sweeps, table, varied
from csm.reproduction.study import FilledMatrix
from tests.evaluation.test_report import row as result_row
from tests.reproduction.toys import toy_context


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
    return [row, replace(row, matching="argmax", age=0.03)]


def test_the_paper_and_the_classifier_stand_beside_ours(rows):
    columns, (line,) = table(rows)
    assert columns[:4] == ("method", "5000 paper", "5000 ours", "5000 argmax")
    assert (line["method"], line["seeds"], line["epochs"]) == ("MGCN", "0 1", 3)
    assert (line["5000 paper"], line["5000 ours"], line["5000 argmax"]) == (70, "20.0 ± 1.0", "30.0 ± 1.0")
    assert [kept["age"] for kept in line["rows"]] == [0.02, 0.03]


def test_what_is_not_of_one_cell_is_in_the_order_of_the_tests(rows):
    more = replace(rows[0], test="SCAPE_12500", age=0.05, exact_match=0.1, p95=0.2)
    columns, (line,) = table([rows[0], more])
    assert columns[1:5] == ("5000 paper", "5000 ours", "12500 paper", "12500 ours")
    assert (line["exact %"], line["95th percentile"]) == ("25 / 10", "- / 200")
    assert "argmax" not in notes([rows[0], more])[0]


def test_every_protocol_says_what_it_is_of(rows):
    mine = replace(rows[0], method="mine", protocol="other pairs")
    first, *protocols = notes([*rows, mine])
    assert "nearest learned descriptor" in first
    assert protocols == ["SCAPE_5000 (scape_mgcn): some pairs", "SCAPE_5000 (mine): other pairs"]
    assert notes(rows)[1] == "SCAPE_5000: some pairs"


def test_names_of_sets_are_shortened_by_what_they_share_and_the_paper_has_columns_where_it_has_errors(rows):
    columns, _ = table([replace(rows[0], train="humans", test="humans_refined_10000")])
    assert columns[1:3] == ("refined_10000 ours", "exact %")
    columns, _ = table([replace(rows[0], train="original", test="refined_10000")])
    assert columns[1:3] == ("refined_10000 ours", "exact %")


def test_curves_are_means_over_seeds_with_a_panel_per_test_set(tmp_path, rows, monkeypatch):
    drawn = {}
    monkeypatch.setattr("csm.reproduction.learned.curve_panels", drawn.update)
    curves(tmp_path, rows[:1])
    assert list(drawn) == ["SCAPE_5000"]
    assert drawn["SCAPE_5000"]["MGCN"].cqc.tolist() == pytest.approx([0.1, 0.6, 1.0])


def test_dots_are_the_mean_errors_in_one_picture(tmp_path, rows, monkeypatch):
    drawn = []
    monkeypatch.setattr("csm.reproduction.learned.dots_figure", lambda *given: drawn.append(given))
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


def test_options_that_rows_change_are_found_and_two_at_once_refused():
    settings: dict[str, Mapping[str, object]] = {
        "base": {"model.ks": 128, "model.terms": 10, "seed": 0},
        "ks_64": {"model.ks": 64, "model.terms": 10, "seed": 0},
        "terms_6": {"model.ks": 128, "model.terms": 6, "seed": 0},
    }
    assert varied(FilledMatrix([], settings)) == {
        "eigenpairs $K_s$": {128: "base", 64: "ks_64"},
        "terms": {10: "base", 6: "terms_6"},
    }
    both = settings | {"both": {"model.ks": 1, "model.terms": 1, "seed": 0}}
    with pytest.raises(ConfigError, match=r"both differs from base in model.ks, model.terms; wanted one"):
        varied(FilledMatrix([], both))
    with pytest.raises(ConfigError, match="same differs from base in nothing"):
        varied(FilledMatrix([], settings | {"same": settings["base"]}))


@pytest.mark.parametrize("picture", ["dots", "curves", "sweeps"])
def test_a_study_fills_its_matrix_and_says_what_it_shows(tmp_path, rows, picture):
    asked = []
    other = replace(rows[0], method="scape_paper", seeds=(0,))
    curve = tmp_path / "scape_paper" / "seed0" / "SCAPE_5000_exact_diameter.cqc.csv"
    curve.parent.mkdir(parents=True)
    curve.write_text("threshold,SCAPE_5000\n0,0.2\n0.1,1\n0.2,1\n")

    def fill(experiment: str, folder: Path, overrides: Sequence[str]) -> FilledMatrix:
        asked.append((experiment, folder, overrides))
        return FilledMatrix([*rows, other], {"scape_mgcn": {"model.ks": 3}, "scape_paper": {"model.ks": 4}})

    context = replace(toy_context(tmp_path), out=tmp_path, fill_matrix=fill)
    study = Learned("table5", experiment="table5", cells="", picture=picture, overrides=("seeds=[0]",))
    found = study.run(context)
    assert asked == [("table5", tmp_path, ("seeds=[0]",))]
    assert [row["method"] for row in found.rows] == ["MGCN", "CSMCNN"]
    assert found.title == (
        "Mean geodesic error in thousandths of the diameter; trained on SCAPE_5000, tested on SCAPE_5000."
    )
    assert found.pictures[0].is_file()


def test_networks_are_trained_by_the_command_only(tmp_path):
    with pytest.raises(ConfigError, match="csm reproduce has it"):
        Learned("table4", experiment="table4", cells="faust", picture="dots").run(toy_context(tmp_path))
