from __future__ import annotations

from dataclasses import replace

import pytest
from hydra import compose, initialize_config_dir

from csm.commands.app import config_folder
from csm.commands.learned import PURPOSES, findings
from csm.evaluation.report import ResultRow
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
        for kind in ("", "_argmax"):
            file = tmp_path / "scape_mgcn" / f"seed{seed}" / f"SCAPE_5000_exact_diameter{kind}.cqc.csv"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(f"threshold,SCAPE_5000\n0,0.1\n0.1,{half}\n0.2,1\n")
    return [row, replace(row, method="scape_mgcn, argmax", age=0.03)]


def test_the_paper_stands_beside_ours_and_curves_are_means_over_seeds(tmp_path, rows, monkeypatch):
    drawn = {}
    monkeypatch.setattr("csm.commands.learned.cqc_figure", drawn.update)
    monkeypatch.setattr("csm.commands.learned.save_figure", lambda path, figure: None)
    found = findings("table5", tmp_path, rows)
    by_descriptor, by_class = found.rows
    assert (by_descriptor["SCAPE_5000 paper"], by_descriptor["SCAPE_5000"]) == (70, "20.0 ± 1.0")
    assert (by_class["SCAPE_5000 paper"], by_class["SCAPE_5000"]) == (None, "30.0 ± 1.0")
    assert [path.name for path in found.pictures] == ["figure8_SCAPE_5000.png"]
    assert drawn["scape_mgcn, argmax"].cqc.tolist() == pytest.approx([0.1, 0.6, 1.0])


@pytest.mark.parametrize("name", PURPOSES)
def test_every_learned_table_is_an_experiment_whose_rows_the_paper_has(name):
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        rows = compose("matrix", [f"experiment={name}"]).rows
    published = {method for method in LEARNED_AGE if method.split("_")[0] == next(iter(rows)).split("_")[0]}
    assert published - set(rows) <= {"scape_release"}
