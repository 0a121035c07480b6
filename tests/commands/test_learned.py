from __future__ import annotations

from dataclasses import replace

import pytest
from hydra import compose, initialize_config_dir

from csm.commands.app import config_folder
from csm.commands.learned import LEARNED, curves, dots, findings
from csm.commands.matrix import chosen_rows
from csm.evaluation.report import ResultRow
from csm.studies.contenders import row_title
from csm.studies.published import LEARNED_AGE


@pytest.fixture
def rows(tmp_path) -> list[ResultRow]:
    row = ResultRow(
        table="table5",
        method="scape_mgcn",
        train="SCAPE_5000",
        test="SCAPE_5000",
        age=0.02,
        age_std=0.001,
        exact_match=0.25,
        seeds=(0, 1),
        epochs=3,
        pairs=380,
        distance="exact",
        normaliser="diameter",
        command="csm matrix",
        commit="abc",
        versions={},
        seconds=1.0,
        protocol="some pairs",
    )
    for seed, half in ((0, 0.4), (1, 0.8)):
        file = tmp_path / "scape_mgcn" / f"seed{seed}" / "SCAPE_5000_exact_diameter.cqc.csv"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"threshold,SCAPE_5000\n0,0.1\n0.1,{half}\n0.2,1\n")
    return [row, replace(row, method="scape_mgcn, argmax", age=0.03)]


def test_the_paper_stands_beside_ours(rows):
    found = findings("table5", rows)
    by_descriptor, by_class = found.rows
    assert (by_descriptor["method"], by_class["method"]) == ("MGCN", "MGCN, argmax")
    assert (by_descriptor["SCAPE_5000 paper"], by_descriptor["SCAPE_5000"]) == (70, "20.0 ± 1.0")
    assert (by_class["SCAPE_5000 paper"], by_class["SCAPE_5000"]) == (None, "30.0 ± 1.0")


def test_curves_are_means_over_seeds_with_a_panel_per_test_set(tmp_path, rows, monkeypatch):
    drawn = {}
    monkeypatch.setattr("csm.commands.learned.curve_panels", drawn.update)
    curves(tmp_path, rows[:1])
    assert list(drawn) == ["SCAPE_5000"]
    assert drawn["SCAPE_5000"]["MGCN"].cqc.tolist() == pytest.approx([0.1, 0.6, 1.0])


def test_dots_are_the_mean_errors_in_one_picture(tmp_path, rows, monkeypatch):
    drawn = []
    monkeypatch.setattr("csm.commands.learned.dots_figure", lambda *given: drawn.append(given))
    dots(tmp_path, [rows[0], replace(rows[0], method="scape_paper", test="SCAPE_12500")])
    ((names, panels),) = drawn
    assert names == ["MGCN", "CSMCNN"]
    (values,) = panels.values()
    assert values["SCAPE_5000"][0] == pytest.approx(20)
    assert values["SCAPE_12500"][0] != values["SCAPE_12500"][0]  # not measured


def experiment(name: str, *overrides: str):
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        return compose("matrix", [f"experiment={name}", *overrides])


@pytest.mark.parametrize("name", ["table4", "table5"])
def test_the_rows_of_the_tables_are_those_of_the_paper(name):
    rows = experiment(name).rows
    published = {method for method in LEARNED_AGE if method.split("_")[0] == next(iter(rows)).split("_")[0]}
    assert published - set(rows) <= {"scape_release"}


def test_studies_that_share_a_folder_mean_the_same_by_a_row_of_one_name():
    by_folder: dict[str, dict[str, list[str]]] = {}
    for study in LEARNED.values():
        known = by_folder.setdefault(study.cells, {})
        for row, overrides in experiment(study.experiment).rows.items():
            assert known.setdefault(str(row), list(overrides)) == list(overrides)


def test_the_figures_compare_what_their_captions_say():
    figure9, figure11 = (list(chosen_rows(experiment(name))) for name in ("figure9", "figure11"))
    assert [row_title(row) for row in figure9] == ["CSMCNN", "ACD + MGCN", "ACD + DiffusionNet"]
    assert [row_title(row) for row in figure11] == ["ACD alone", "ACD + MLP", "CSMCNN"]
