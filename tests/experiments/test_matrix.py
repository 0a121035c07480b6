"""A matrix is filled cell by cell, and what is there is taken only for what it is."""

from __future__ import annotations

import json
import pickle
from collections.abc import Sequence
from pathlib import Path

import pytest

from csm._locks import locked
from csm.errors import ConfigError, DataError
from csm.evaluation import EvaluationProtocol
from csm.evaluation.report import ResultRow, read_rows
from csm.experiments import matrix as module
from csm.experiments.matrix import Matrix, Row, keep_training, require_same_training
from csm.experiments.resuming import last_checkpoint
from csm.experiments.training import Training
from csm.matching.network import load_model
from tests.experiments.toys import a_training

PROTOCOL = EvaluationProtocol(points=40, distance="edge")
IDENTITY = {"seed": 0, "model.name": "csmcnn", "learning.loss_rows": None, "data.basis_k": 24}


class Bench:
    """A folder for a matrix, and notes of what is trained and tested."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.trained, self.tested = folder, [], []
        fit, measure_set = module.fit, module.measure_set

        def watched_fit(training: Training, place: Path):
            self.trained.append((training.name, training.seed, last_checkpoint(place).exists()))
            return fit(training, place)

        def watched_measure(method, data, shapes, protocol, **options):
            self.tested.append((method.name, shapes.name, tuple(options["matching"])))
            return measure_set(method, data, shapes, protocol, **options)

        monkeypatch.setattr(module, "fit", watched_fit)
        monkeypatch.setattr(module, "measure_set", watched_measure)

    def row(self, name: str = "one", seed: int = 0, **changes: object) -> Row:
        return Row(
            name, seed, lambda: a_training(self.folder, name=name, seed=seed), IDENTITY | {"seed": seed} | changes
        )

    def fill(self, rows: Sequence[Row], **options: object) -> list[ResultRow]:
        self.trained.clear()
        self.tested.clear()
        return Matrix(self.folder / "cells", PROTOCOL, **options).fill(rows)  # type: ignore[arg-type]

    def place(self, name: str = "one", seed: int = 0) -> Path:
        return self.folder / "cells" / name / f"seed{seed}"


@pytest.fixture
def bench(tmp_path, monkeypatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


def test_a_matrix_is_trained_tested_averaged_and_resumed_cell_by_cell(bench):
    rows = [bench.row(seed=seed) for seed in (0, 1)]
    table = bench.fill(rows, matching=("nearest", "argmax"), table="mine")
    assert bench.trained == [("one", 0, False), ("one", 1, False)]
    assert [(r.method, r.matching, r.seeds, r.test) for r in table] == [
        ("one", "nearest", (0, 1), "toys"),
        ("one", "argmax", (0, 1), "toys"),
    ]
    assert table[0].age_std is not None
    assert read_rows(bench.folder / "cells/mine.json") == table
    names = {path.name for path in bench.place().iterdir()}
    assert {"model.ckpt", "row.json", "toys_edge_diameter.json", "toys_edge_diameter_argmax.json"} <= names
    assert "toys_edge_diameter.cqc.csv" in names
    assert "the worst pair" in (bench.place() / "toys_edge_diameter_argmax.html").read_text(encoding="utf-8")
    assert bench.fill(rows, matching=("nearest", "argmax"), table="mine") == table
    assert (bench.trained, bench.tested) == ([], [])

    (bench.place() / "toys_edge_diameter_argmax.json").unlink()
    (bench.place(seed=1) / "model.ckpt").unlink()  # its cells are there, so nothing is asked of it
    again = bench.fill(rows, matching=("nearest", "argmax"), table="mine")
    assert bench.tested == [("one", "toys", ("argmax",))]
    assert bench.trained == []
    assert [r.age for r in again] == pytest.approx([r.age for r in table])

    left = bench.fill(rows, train=False)
    assert [r.seeds for r in left] == [(0,)], "a network that is not there is left out with its cells"


def test_a_training_that_was_ended_goes_on_from_its_last_epoch(bench):
    bench.fill([bench.row()])
    (bench.place() / "model.ckpt").unlink()
    (bench.place() / "toys_edge_diameter.json").unlink()
    bench.fill([bench.row()])
    assert bench.trained == [("one", 0, True)]


def test_the_network_of_a_row_is_that_of_its_folder(bench):
    (table,) = bench.fill([bench.row()])
    assert load_model(bench.place() / "model.ckpt").name == "one"
    (bench.place() / "toys_edge_diameter.json").unlink()
    assert bench.fill([bench.row()])[0].age == pytest.approx(table.age)
    assert (bench.trained, bench.tested) == ([], [("one", "toys", ("nearest",))])


def test_cells_of_another_protocol_are_measured_again(bench, caplog):
    bench.fill([bench.row()])
    path = bench.place() / "toys_edge_diameter.json"
    (entry,) = json.loads(path.read_text())
    path.write_text(json.dumps([entry | {"protocol": "some other pairs"}]))
    bench.fill([bench.row()])
    assert bench.tested == [("one", "toys", ("nearest",))]
    assert "answers another protocol (some other pairs)" in caplog.text


def test_rows_of_the_first_format_are_taken(bench):
    (first, by_class) = bench.fill([bench.row()], matching=("nearest", "argmax"))
    path = bench.place() / "toys_edge_diameter_argmax.json"
    (entry,) = json.loads(path.read_text())
    del entry["matching"]
    path.write_text(json.dumps([entry | {"method": "one, argmax"}]))
    assert bench.fill([bench.row()], matching=("nearest", "argmax")) == [first, by_class]
    assert bench.tested == []


def test_a_cell_that_another_matrix_measured_belongs_to_this_table(bench):
    bench.fill([bench.row()], table="first")
    (second,) = bench.fill([bench.row(seed=seed) for seed in (0, 1)], table="second")
    assert (second.table, second.seeds) == ("second", (0, 1))
    assert bench.tested == [("one", "toys", ("nearest",))]


def test_rows_that_fail_are_listed_when_the_others_are_done(bench):
    def broken() -> Training:
        raise DataError("toys: the folder is gone")

    rows = [Row("bad", 0, broken, IDENTITY), bench.row("good")]
    with pytest.raises(ConfigError, match=r"1 row of the matrix failed, .*:\nbad, seed 0: toys: the folder is gone"):
        bench.fill(rows)
    assert [r.method for r in read_rows(bench.folder / "cells/matrix.json")] == ["good"]


@pytest.mark.parametrize("unknown", [{"matching": ("nope",)}, {"device": "nope"}])
def test_what_a_test_wants_is_checked_before_the_training(bench, unknown):
    with pytest.raises(ConfigError, match="nope"):
        bench.fill([bench.row()], **unknown)
    assert bench.trained == []


def test_without_a_network_and_a_training_there_is_no_table(bench, caplog):
    with pytest.raises(ConfigError, match=r"no network of these rows and seeds is trained, and train=false"):
        bench.fill([bench.row()], train=False)
    assert "one, seed 0: not trained yet, left out (train=false)" in caplog.text
    assert not (bench.folder / "cells").exists()


def test_the_shapes_of_a_row_do_not_stay_in_memory(bench):
    row = bench.row()
    bench.fill([row])
    assert set(vars(row)) == {"name", "seed", "make", "identity"}


def test_a_row_that_was_trained_otherwise_is_not_taken_for_another(bench):
    (first,) = bench.fill([bench.row()])
    with pytest.raises(ConfigError, match=r"one/seed0 was trained otherwise \(data\.basis_k: 24 there, 99 wanted\)"):
        bench.fill([bench.row(**{"data.basis_k": 99})])
    assert bench.fill([bench.row()]) == [first]
    bench.fill([bench.row(**{"learning.rotate": False})])  # an option of a later version that is off
    with pytest.raises(ConfigError, match=r"learning\.rotate: None there, True wanted"):
        bench.fill([bench.row(**{"learning.rotate": True})])


OLD = {
    "seed": 0,
    "data._target_": "csm.data.datasets.FaustDataModule",
    "data.split": "faust_80_20.json",
    "data.basis_k": 128,
    "descriptor._target_": "csm.descriptors.ACD",
    "model.name": "mgcn",
    "model.channels": [16, 16],
    "optimizer.lr": 0.001,
    "optimizer.loss_rows": 1024,
    "optimizer.loss_products": "bfloat16",
    "optimizer.rotate": False,
    "trainer.max_epochs": 20,
}
TODAY = {
    "seed": 0,
    "data._target_": "csm.data.faust.FaustDataModule",
    "data.split": "faust_80_20",
    "data.basis_k": 128,
    "descriptor._target_": "csm.descriptors.acd.ACD",
    "model.name": "mgcn",
    "model.channels": (16, 16),
    "optimizer.lr": 0.001,
    "learning.loss_rows": 1024,
    "learning.loss_products": "bfloat16",
    "learning.rotate": False,
    "trainer.max_epochs": 20,
}


def test_the_record_of_an_earlier_version_is_understood(tmp_path):
    (tmp_path / "row.json").write_text(json.dumps(OLD))
    require_same_training(tmp_path, TODAY)
    assert json.loads((tmp_path / "row.json").read_text()) == OLD, "it stays as it was"
    for key, value in {
        "learning.loss_rows": None,
        "data.split": "other",
        "data._target_": "csm.data.scape.ScapeDataModule",
        "optimizer.lr": 0.01,
    }.items():
        with pytest.raises(ConfigError, match=key):
            require_same_training(tmp_path, TODAY | {key: value})


def test_a_record_is_made_once_and_holds_plain_data(tmp_path):
    keep_training(tmp_path / "new", TODAY)
    kept = json.loads((tmp_path / "new/row.json").read_text())
    assert (kept["data._target_"], kept["model.channels"]) == ("FaustDataModule", [16, 16])
    require_same_training(tmp_path / "new", TODAY)
    require_same_training(tmp_path / "new", OLD)


def test_a_matrix_survives_pickling(tmp_path):
    again = pickle.loads(pickle.dumps(Matrix(tmp_path, PROTOCOL, ("nearest",))))
    assert (again.folder, again.protocol) == (tmp_path, PROTOCOL)


@pytest.mark.parametrize("content", [None, "{", "[]"])
def test_without_its_settings_a_folder_is_judged_by_its_network(bench, content, caplog):
    bench.fill([bench.row()])
    path = bench.folder / "cells/one/seed0/row.json"
    path.unlink() if content is None else path.write_text(content)
    bench.fill([bench.row()])
    assert bench.trained == []
    assert json.loads(path.read_text())["seed"] == 0
    path.unlink() if content is None else path.write_text(content)
    other = Row("one", 0, lambda: a_training(bench.folder, name="one", options={"lr": 0.5}), IDENTITY)
    with pytest.raises(ConfigError, match=r"lr: 0\.01 there, 0\.5 wanted"):
        bench.fill([other])
    with pytest.raises(ConfigError, match="lr: 0"):
        bench.fill([other])


def test_two_runs_fill_one_matrix_side_by_side_and_no_row_twice(bench):
    one, two = bench.row("one"), bench.row("two")
    bench.fill([two])
    with (
        locked(bench.place("one") / "row.json", wait=0),
        pytest.raises(ConfigError, match=r"one, seed 0: .*row\.json: another run of csm has kept this file"),
    ):
        bench.fill([one, two], matching=("nearest", "argmax"))
    assert (bench.trained, bench.tested) == ([], [("two", "toys", ("argmax",))])
    assert {row.method for row in bench.fill([one, two])} == {"one", "two"}
    assert bench.trained == [("one", 0, False)]
