"""What a test wants is checked before the training, not after it."""

from __future__ import annotations

import json

import pytest
import yaml
from omegaconf import OmegaConf

from csm.commands.training import ends_before_validation, with_objective
from tests.commands.test_pipeline import SMALL, Bench

TOYS = [*SMALL, "data.root=toys"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*TOYS, "matching=[nope]"], "matching='nope'"),
        ([*TOYS, "device=meta"], "device=meta"),
        ([*TOYS, "metric.distance=nope"], "metric.distance=nope"),
        ([*TOYS, "objective=val/age"], "objective=val/age: no two shapes are held out"),
        ([*TOYS, "objective=val/age", "data.holdout=1"], "objective=val/age: no two shapes are held out"),
        ([*TOYS, "objective=val/age", "data.holdout=2", "trainer.max_epochs=9"], "wanted at most 9"),
        ([*TOYS, "objective=nonsense"], "objective=nonsense: no job has a number of that name"),
        ([*TOYS, "objective=fit/age", "callbacks=none"], "fit/age: the callback that measures it was left out"),
        ([*TOYS, "objective=age/toys", "test=false"], "objective=age/toys: test=false leaves it out"),
        ([*TOYS, "pretrained=nowhere.ckpt"], "nowhere.ckpt: there is no such checkpoint"),
        ([*TOYS, "pretrained=humans"], "wanted descriptor=acd_two_bands, or a recipe that has it"),
        (["recipe=acscnn", "experiment=humans_paper"], "experiment=humans_paper chooses csmcnn"),
    ],
)
def test_an_error_comes_before_the_training(tmp_path, monkeypatch, capsys, arguments, message):
    bench = Bench(tmp_path, monkeypatch)
    with pytest.raises(SystemExit) as stopped:
        bench.run("train", *arguments, "hydra.run.dir=run")
    assert stopped.value.code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "run/model.ckpt").exists()


@pytest.mark.parametrize(
    ("every", "epochs", "never"), [(5, 4, True), (5, 5, False), (5, -1, False), (5, 0, False), (None, 3, False)]
)
def test_a_short_training_ends_before_its_first_validation(every, epochs, never):
    trainer = {"check_val_every_n_epoch": every, "max_epochs": epochs}
    assert ends_before_validation(OmegaConf.create({"trainer": trainer})) == never


def test_one_thing_is_said_of_the_validation(tmp_path, monkeypatch, capsys):
    bench = Bench(tmp_path, monkeypatch)
    small = [*TOYS, "test=false", "data.holdout=2", "trainer.max_epochs=1", "logger=none"]
    bench.run("train", *small, "trainer.check_val_every_n_epoch=2", "hydra.run.dir=none")
    said = capsys.readouterr().out
    assert "not validated, as trainer.check_val_every_n_epoch=2 is more than trainer.max_epochs=1; " in said
    assert said.count("validat") == 1
    bench.run("train", *small, "trainer.check_val_every_n_epoch=1", "hydra.run.dir=one")
    said = capsys.readouterr().out
    assert "validated on 2 held-out training shapes; " in said
    assert "not validated" not in said


@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_rows_of_another_test_are_not_replaced(tmp_path, monkeypatch, capsys, command):
    bench = Bench(tmp_path, monkeypatch)
    small = [*TOYS, "trainer.max_epochs=1", "trainer.check_val_every_n_epoch=1", "logger=none", "callbacks=none"]
    words = {"train": small, "evaluate": ["checkpoint=run/model.ckpt", "data=folder", "data.root=toys"]}[command]
    words = [command, *words, "data.n_test=2", "metric.distance=edge"]
    if command == "evaluate":
        bench.run("train", *small, "test=false", "hydra.run.dir=run")
    bench.run(*words, "metric.points=20", "hydra.run.dir=here")
    before = {path: path.read_bytes() for path in (tmp_path / "here").iterdir() if path.is_file()}
    assert len(before) > 4
    with pytest.raises(SystemExit) as stopped:
        bench.run(*words, "metric.points=30", "hydra.run.dir=here")
    assert stopped.value.code == 2
    assert "on toys (nearest) by a test with another protocol, which this one would replace" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in before} == before
    bench.run(*words, "metric.points=20", "hydra.run.dir=here")


def test_a_sweeper_is_told_the_number_that_it_makes_small(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch)
    short = ["trainer.max_epochs=4", "trainer.check_val_every_n_epoch=4", "data.holdout=2", "test=false"]
    bench.run("train", *TOYS, *short, "objective=val/age", "hydra.run.dir=run")
    record = json.loads((tmp_path / "run/result.json").read_text())
    assert record["objective"] == record["val/age"] > 0


def test_an_objective_that_a_job_does_not_have_is_answered_with_those_that_it_has(capsys):
    found = {"seconds": 1.0, "checkpoint": "x", "val/age": 0.1}
    assert with_objective(found, "val/eag") == found
    assert "objective=val/eag: the job has no such number; it has seconds, val/age" in capsys.readouterr().err
    assert with_objective(found, None) == found


def test_optuna_tries_settings_and_keeps_the_best(tmp_path, monkeypatch):
    pytest.importorskip("optuna", reason='Optuna is not installed: pip install "csm-correspondence[sweep]"')
    bench = Bench(tmp_path, monkeypatch)
    small = [*TOYS, "descriptor=acd_paper", "learning.places=0", "data.holdout=2"]
    small += ["trainer.max_epochs=1", "trainer.check_val_every_n_epoch=1"]
    small.remove("model.dropout=0")
    bench.run("train", "experiment=tune", *small, "hydra.sweeper.n_trials=2", "hydra.sweep.dir=sweep", "-m")
    best = yaml.safe_load((tmp_path / "sweep/optimization_results.yaml").read_text())
    jobs = [json.loads((tmp_path / f"sweep/{job}/result.json").read_text()) for job in (0, 1)]
    assert best["best_value"] == min(job["objective"] for job in jobs)
    assert len({job["overrides"][0] for job in jobs}) == 2
