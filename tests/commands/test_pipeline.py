"""The commands as a user types them, on a toy set: prepare, train, sweep, evaluate, matrix, match."""

from __future__ import annotations

import csv
import importlib
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from csm.evaluation.report import read_rows
from csm.mesh.io import read_mesh
from tests.toyset import write_toys

SMALL = [
    "data=folder",
    "data.n_test=2",
    "data.basis_k=24",
    "descriptor.angles=4",
    "descriptor.k=8",
    "descriptor.order=3",
    "model.channels=[16,16,16]",
    "model.descriptor_channels=24",
    "model.ks=20",
    "model.dropout=0",
    "optimizer.lr=0.01",
    "trainer.max_epochs=60",
    "trainer.accelerator=cpu",
    "trainer.check_val_every_n_epoch=30",
    "workers=0",
]

POINTS = "metric.points=100"  # of the 162: the pictures need all of them, the table does not


class Bench:
    """A folder with toy meshes, and a way to run commands in it."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.monkeypatch = folder, monkeypatch
        monkeypatch.chdir(folder)
        monkeypatch.setenv("CSM_CACHE", str(folder / "store"))
        if not (folder / "toys").exists():
            write_toys(folder / "toys")

    def run(self, command: str, *arguments: str) -> None:
        self.monkeypatch.setattr(sys, "argv", [f"csm {command}", *arguments])
        importlib.import_module(f"csm.commands.{command}").main()

    def json(self, path: str) -> dict:
        return json.loads((self.folder / path).read_text())


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("pipeline")


@pytest.fixture
def bench(folder, monkeypatch) -> Bench:
    return Bench(folder, monkeypatch)


@pytest.fixture
def trained(bench) -> str:
    """Train once; give the checkpoint."""
    if not (bench.folder / "run/model.ckpt").exists():
        bench.run("train", *SMALL, "data.root=toys", "name=toy", "hydra.run.dir=run", "results=results.json", POINTS)
    return "run/model.ckpt"


def test_training_leaves_a_checkpoint_an_export_rows_curves_and_its_numbers(bench, trained):
    result = bench.json("run/result.json")
    assert result["status"] == "ok"
    assert result["age/toys"] < 0.1
    assert (bench.folder / "run/export/model.safetensors").exists()
    assert (bench.folder / "run/checkpoints/last.ckpt").exists()
    assert list((bench.folder / "run/tensorboard").glob("events*"))
    (row,) = read_rows(bench.folder / "run/rows.json")
    assert (row.method, row.train, row.test, row.pairs, row.epochs) == ("toy", "toys", "toys", 2, 60)
    assert row.age == pytest.approx(result["age/toys"])
    assert read_rows(bench.folder / "results.json") == [row]
    assert {"report.html", "cqc.png", "map_toys.png"} <= {path.name for path in (bench.folder / "run").iterdir()}
    assert (bench.folder / "run/cqc.csv").read_text().startswith("threshold,toys")


@pytest.mark.parametrize("checkpoint", ["run/model.ckpt", "run/export/model.json"])
def test_a_checkpoint_evaluates_to_the_same_numbers_without_its_config(bench, trained, checkpoint):
    options = ["data=folder", "data.root=toys", "data.n_test=2", "hydra.run.dir=eval", POINTS]
    bench.run("evaluate", f"checkpoint={checkpoint}", *options)
    assert bench.json("eval/result.json")["age/toys"] == pytest.approx(bench.json("run/result.json")["age/toys"])


def test_the_classifier_matches_as_well_where_it_is_there(bench, trained, capsys):
    options = ["data=folder", "data.root=toys", "data.n_test=3", "hydra.run.dir=votes", POINTS]
    bench.run("evaluate", "checkpoint=run/model.ckpt", "matching=[nearest,argmax]", *options)
    assert "which is not the split of the training" in capsys.readouterr().out
    by_descriptor, by_class = read_rows(bench.folder / "votes/rows.json")
    assert [(row.method, row.matching) for row in (by_descriptor, by_class)] == [("toy", "nearest"), ("toy", "argmax")]
    assert 0 < by_class.age < 0.1
    assert by_class.age != by_descriptor.age
    assert (bench.folder / "votes/map_toys_argmax.png").exists()
    assert (bench.folder / "votes/cqc.csv").read_text().startswith('threshold,toys,"toys, argmax"')
    with pytest.raises(SystemExit):
        bench.run("evaluate", "checkpoint=run/export/model.json", "matching=[argmax]", *options)
    assert "use the .ckpt" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "left"),
    [
        ("logger=csv", "csv"),
        *((words, None) for words in ("logger=none", "logger=null", "~logger", "trainer=cpu logger=none")),
        *((words, None) for words in ("callbacks=none logger=none", "~callbacks logger=none")),
    ],
)
def test_loggers_callbacks_and_trainers_are_chosen_by_a_word(bench, words, left):
    folder = "logged_" + words.translate(str.maketrans({"=": "_", " ": "_", "~": "_"}))
    short = ["data.root=toys", "trainer.max_epochs=1", "test=false", f"hydra.run.dir={folder}"]
    bench.run("train", *SMALL, *short, *words.split())
    assert (bench.folder / folder / "checkpoints/last.ckpt").is_file()
    logs = {path.name for path in (bench.folder / folder).iterdir()} & {"tensorboard", "csv", "lightning_logs"}
    assert logs == ({left} if left else set())


@pytest.mark.long
def test_the_number_of_workers_changes_nothing(bench, trained):
    rows = []
    for workers in (1, 2):
        options = ["data=folder", "data.root=toys", "data.n_test=3", POINTS, f"hydra.run.dir=eval{workers}"]
        bench.run("evaluate", f"checkpoint={trained}", *options, f"workers={workers}")
        (row,) = read_rows(bench.folder / f"eval{workers}/rows.json")
        rows.append(replace(row, seconds=0.0, command="csm evaluate", commit="any"))
    assert rows[0] == rows[1]
    assert rows[0].pairs == 6


def test_a_sweep_goes_on_after_a_failing_job_and_ends_in_one_table(bench, capsys):
    with pytest.raises(SystemExit) as stopped:
        bench.run(
            "train", "-m", *SMALL, "data.root=toys", "trainer.max_epochs=1", "model.ks=20,999,10", "hydra.sweep.dir=s"
        )
    assert stopped.value.code == 2
    rows = list(csv.DictReader((bench.folder / "s/sweep.csv").open()))
    assert [row["status"] for row in rows] == ["ok", "failed", "ok"]
    assert "999 eigenpairs" in rows[1]["error"]
    assert float(rows[2]["age/toys"]) > 0


def test_a_matrix_is_resumed_cell_by_cell(bench, capsys):
    row = "+rows.toy=[" + ",".join(f"'{x}'" for x in (*SMALL, "data.root=toys", "trainer.max_epochs=2")) + "]"
    arguments = ["seeds=[0,1]", "folder=cells", "results=matrix.json", row]
    bench.run("matrix", *arguments)
    (table,) = read_rows(bench.folder / "matrix.json")
    assert table.seeds == (0, 1)
    assert table.age_std is not None
    cells = sorted((bench.folder / "cells/toy").glob("seed*/toys_exact_diameter.json"))
    cells[0].unlink()
    (bench.folder / "cells/toy/seed1/model.ckpt").unlink()
    before = cells[1].stat().st_mtime_ns, (bench.folder / "cells/toy/seed0/model.ckpt").stat().st_mtime_ns
    bench.run("matrix", *arguments)
    assert cells[0].exists()
    assert (cells[1].stat().st_mtime_ns, (bench.folder / "cells/toy/seed0/model.ckpt").stat().st_mtime_ns) == before
    assert not (bench.folder / "cells/toy/seed1/model.ckpt").exists()
    (again,) = read_rows(bench.folder / "matrix.json")
    assert again.age == pytest.approx(table.age)
    bench.run("matrix", *arguments[1:], "seeds=[0,1]", "train=false")  # of seed 1 there is a cell, but no network
    (left,) = read_rows(bench.folder / "cells/matrix.json")
    assert left.seeds == (0,)
    with pytest.raises(SystemExit):
        bench.run("matrix", *arguments, "folder=empty", "train=false")
    assert "no network of these rows" in capsys.readouterr().err


def test_a_matrix_fills_only_the_rows_asked_for_and_ends_a_training_in_time(bench, capsys):
    options = [*SMALL, "data.root=toys", "trainer.max_epochs=99999", "trainer.max_time='00:00:00:02'"]
    rows = [f"+rows.{name}=[" + ",".join(f'"{x}"' for x in options) + "]" for name in ("one", "two")]
    bench.run("matrix", "folder=timed", "only=[two]", *rows)
    (row,) = read_rows(bench.folder / "timed/matrix.json")
    assert row.method == "two"
    assert 0 < row.epochs < 9999
    with pytest.raises(SystemExit):
        bench.run("matrix", "folder=timed", "only=[three]", *rows)
    assert "no row three; it has one, two" in capsys.readouterr().err


def test_a_row_that_was_trained_otherwise_is_not_taken_for_another(bench, capsys):
    def fill(*changes):
        options = ",".join(f'"{x}"' for x in (*SMALL, "data.root=toys", *changes))
        bench.run("matrix", "folder=shared", f"+rows.one=[{options}]")

    fill()
    fill("data.test_roots=[toys]", "+trainer.enable_progress_bar=false")  # changes nothing of the training
    before = (bench.folder / "shared/one/seed0/model.ckpt").read_bytes()
    with pytest.raises(SystemExit):
        fill("model.dropout=0.25")
    assert "model.dropout: 0 there, 0.25 wanted" in capsys.readouterr().err
    assert (bench.folder / "shared/one/seed0/model.ckpt").read_bytes() == before
    file = bench.folder / "shared/one/seed0/row.json"
    kept = json.loads(file.read_text())
    file.write_text(json.dumps({key: value for key, value in kept.items() if key != "learning.rotate"}))
    fill()  # an option of a later version that is off
    file.write_text(json.dumps({key: value for key, value in kept.items() if key != "optimizer.lr"}))
    with pytest.raises(SystemExit):
        fill()
    assert "optimizer.lr: None there" in capsys.readouterr().err


def test_a_table_of_learned_methods_is_reproduced_from_its_matrix(bench):
    row = "+rows.toy=[" + ",".join(f"'{x}'" for x in (*SMALL, "data.root=toys", "trainer.max_epochs=2")) + "]"
    overrides = OmegaConf.create([row, "only=[toy]", "seeds=[0,1]"])
    bench.run(
        "reproduce",
        "targets=[table4]",
        f"table4.overrides={OmegaConf.to_object(overrides)!r}",
        "out=made",
        "results=shown",
    )
    record = bench.json("shown/table4.json")
    (line,) = record["rows"]
    assert (line["method"], line["seeds"]) == ("toy", "0 1")
    assert "toys paper" not in line
    assert {(row["method"], row["matching"]) for row in line["rows"]} == {("toy", "nearest"), ("toy", "argmax")}
    assert (bench.folder / "shown/table4.png").exists()


@pytest.mark.parametrize("by", ["descriptor=hks descriptor.k=40", "checkpoint=run/model.ckpt"])
def test_two_meshes_are_matched_and_everything_is_written(bench, trained, by):
    out = by.partition("=")[0]
    bench.run("match", "source=toys/toy4.off", "target=toys/toy5.off", f"out={out}", *by.split())
    indices = np.loadtxt(bench.folder / out / "map.txt", dtype=int)
    assert (bench.folder / out / "map.txt").read_text().startswith("# line i = vertex of toy5 that vertex i of toy4")
    np.testing.assert_array_equal(np.load(bench.folder / out / "map.npz")["indices"], indices)
    if out == "checkpoint":
        assert (indices == np.arange(162)).mean() > 0.5
    account = bench.json(f"{out}/match.json")
    assert account["source"]["name"] == "toy4"
    assert "0-based" in account["map"]
    for name in ("source", "target"):
        assert read_mesh(bench.folder / out / f"{name}.ply").n_vertices == 162
    assert "://" not in (bench.folder / out / "match.html").read_text()


def test_prepare_fills_checks_and_prunes(bench, capsys):
    bench.run("prepare", *SMALL, "data.root=toys", "store=mine")
    assert "6 made, 0 already there" in capsys.readouterr().out
    bench.run("prepare", *SMALL, "data.root=toys", "store=mine")
    assert "0 made, 6 already there" in capsys.readouterr().out
    bench.run("prepare", "action=check", "store=mine")
    assert "all sound" in capsys.readouterr().out
    entry = next((bench.folder / "mine/lbo").glob("*.npz"))
    entry.write_bytes(b"")
    with pytest.raises(SystemExit) as stopped:
        bench.run("prepare", "action=check", "store=mine")
    assert stopped.value.code == 2
    assert entry.name in capsys.readouterr().err
    bench.run("prepare", "action=prune", "store=mine")
    assert not entry.exists()


@pytest.mark.parametrize(
    ("command", "arguments", "message"),
    [
        ("train", ["data=faust", "data.root=nowhere"], "wanted FAUST_6890"),
        ("train", [*SMALL, "data.root=toys", "trainer.devices=2"], "several devices train together with trainer=ddp"),
        ("train", [*SMALL, "data.root=toys", "model.ks=999"], "data.basis_k=999"),
        ("train", [*SMALL, "data.root=toys", "model.activation=sine"], "relu"),
        ("train", [*SMALL, "data.root=toys", "descriptor.alpha=-1"], "alpha"),
        ("evaluate", [], "checkpoint=PATH"),
        ("evaluate", ["checkpoint=nothing.ckpt"], "no such checkpoint"),
        ("match", ["source=toys/toy1.off"], "match needs two meshes"),
        ("match", ["source=toys/nothing.off", "target=toys/toy1.off", "out=o"], "there is no such file"),
        ("describe", ["mesh=toys/toy1.off", "out=a.txt"], ".npz"),
        ("check", ["folder=nowhere"], "nowhere"),
        ("matrix", [], "rows"),
        ("prepare", ["action=dance"], "fill, check or prune"),
    ],
)
def test_errors_are_one_paragraph_and_status_2(bench, capsys, command, arguments, message):
    with pytest.raises(SystemExit) as stopped:
        bench.run(command, *arguments, "hydra.run.dir=failed")
    said = capsys.readouterr().err
    assert stopped.value.code == 2
    assert message in said
    assert "Traceback" not in said


def test_describe_writes_values_with_their_columns(bench):
    bench.run(
        "describe", "mesh=toys/toy0.off", "out=d.npz", "descriptor.angles=3", "descriptor.order=1", "descriptor.cuts=1"
    )
    with np.load(bench.folder / "d.npz") as found:
        assert found["values"].shape == (162, 6)
        assert found["columns"][1] == "theta=0.000 T1"
        assert json.loads(str(found["parameters"]))["angles"] == 3
