from __future__ import annotations

import csv
import json

import pytest
from omegaconf import OmegaConf

from csm.commands.sweep import SweepTable, write_csv


def job(folder, number: int, overrides: list[str], result: dict) -> None:
    (folder / str(number)).mkdir(parents=True)
    (folder / str(number) / "result.json").write_text(json.dumps({**result, "overrides": overrides}))


def end_of_sweep(folder) -> None:
    SweepTable().on_multirun_end(OmegaConf.create({"hydra": {"sweep": {"dir": str(folder)}}}))


def test_one_row_per_job_in_order_with_overrides_and_numbers(tmp_path):
    for i in (10, 2):
        job(tmp_path, i, [f"seed={i}", "model.ks=32"], {"status": "ok", "age/humans": i / 100})
    end_of_sweep(tmp_path)
    rows = list(csv.DictReader((tmp_path / "sweep.csv").open()))
    assert [row["job"] for row in rows] == ["2", "10"]
    assert rows[0]["seed"] == "2"
    assert rows[0]["model.ks"] == "32"
    assert rows[1]["age/humans"] == "0.1"


def test_a_failed_job_is_in_the_table_and_ends_the_program_with_status_2(tmp_path, capsys):
    job(tmp_path, 0, ["seed=0"], {"status": "ok", "age": 0.1})
    job(tmp_path, 1, ["seed=1"], {"status": "failed", "error": "no such mesh"})
    with pytest.raises(SystemExit) as stopped:
        end_of_sweep(tmp_path)
    assert stopped.value.code == 2
    assert "job 1 failed: no such mesh" in capsys.readouterr().err
    assert len(list(csv.DictReader((tmp_path / "sweep.csv").open()))) == 2


def test_differing_columns_make_one_table(tmp_path):
    write_csv(tmp_path / "a.csv", [{"a": 1}, {"b": 2, "a": 3}])
    assert (tmp_path / "a.csv").read_text().split() == ["a,b", "1,", "3,2"]
