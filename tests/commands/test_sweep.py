from __future__ import annotations

import csv
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from csm.commands.sweep import SweepTable, write_csv
from csm.data.store import Store
from tests.commands.killing import kill_worker
from tests.toyset import write_toys

ROOT = Path(__file__).resolve().parents[2]
LAUNCHERS = {"joblib": "joblib", "ray": "ray", "submitit_local": "submitit"}
"""Launchers -> the library that runs their jobs."""

TOYS = ("data=folder", "data.root=toys", "data.n_test=2", "data.basis_k=24", "workers=0")
ACD = ("descriptor.angles=4", "descriptor.k=8", "descriptor.order=3")
NETWORK = ("model.channels=[16,16]", "model.descriptor_channels=24", "model.ks=20", "trainer.accelerator=cpu")
RAY = ("hydra/launcher=ray", "+hydra.launcher.ray.init.num_cpus=2", "+hydra.launcher.ray.init.include_dashboard=false")

PATIENT = {"RAY_raylet_start_wait_time_s": "900", "RAY_worker_register_timeout_seconds": "900"}
"""For Ray on a machine that is busy with other things."""


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


@pytest.mark.long
def test_a_finished_job_is_not_done_again_and_a_changed_one_is(csm, tmp_path):
    write_toys(tmp_path / "toys")
    words = ["-m", *TOYS, *ACD, *NETWORK, "seed=0,1", "hydra.sweep.dir=s", "trainer.max_epochs=1", "metric.points=9"]
    assert csm("train", *words, "logger=none")[0] == 0
    made = [(tmp_path / f"s/{i}/model.ckpt").stat().st_mtime_ns for i in (0, 1)]
    (tmp_path / "s/1/model.ckpt").unlink()
    status, said, _ = csm("train", *words, "logger=none")
    assert status == 0
    assert re.findall(r"s/(\d): was finished by an earlier run", said) == ["0"]
    assert (tmp_path / "s/0/model.ckpt").stat().st_mtime_ns == made[0]
    assert (tmp_path / "s/1/model.ckpt").stat().st_mtime_ns > made[1]
    assert [row["status"] for row in csv.DictReader((tmp_path / "s/sweep.csv").open())] == ["ok", "ok"]
    _, said, _ = csm("train", *words, "logger=none", "matching=[argmax]")
    assert "was finished" not in said


def start(folder: Path, command: str, *words: str) -> subprocess.Popen[str]:
    """Start a sweep in a folder with toys, as a user does."""
    if not (folder / "toys").exists():
        write_toys(folder / "toys", 8)
    environment = os.environ | {"CSM_CACHE": str(folder / "store"), "PYTHONPATH": str(ROOT)} | PATIENT
    call = [sys.executable, "-m", f"csm.commands.{command}", "-m", *TOYS, *ACD, *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(call, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True)


def finish(sweep: subprocess.Popen[str]) -> str:
    """Wait for a sweep to end well, and return what it said."""
    said, errors = sweep.communicate(timeout=1800)
    assert sweep.returncode == 0, said + errors
    return said


def jobs(folder: Path) -> list[dict[str, str]]:
    with (folder / "s/sweep.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.long
@pytest.mark.parametrize("launcher", [name for name in LAUNCHERS if importlib.util.find_spec(LAUNCHERS[name])])
def test_a_preparation_is_shared_by_the_jobs_of_every_launcher(tmp_path, launcher):
    how = RAY if launcher == "ray" else (f"hydra/launcher={launcher}",)
    finish(start(tmp_path, "prepare", *how, "shards=3", "shard=0,1,2", "hydra.sweep.dir=s", "model=mlp"))
    assert [int(job["made"]) for job in jobs(tmp_path)] == [3, 3, 2]
    assert [path.parent.name for path in Store(tmp_path / "store").files()].count("descriptor") == 8


@pytest.mark.long
@pytest.mark.skipif(not importlib.util.find_spec("ray"), reason='needs Ray: pip install "csm-correspondence[sweep]"')
def test_a_training_whose_worker_is_killed_ends_as_if_it_had_not_been(tmp_path):
    kill = f"+callbacks.kill={{_target_: tests.commands.killing.KillOnce, epoch: 3, flag: '{tmp_path}/killed'}}"
    words = (*NETWORK, "trainer.max_epochs=5", "metric.points=9", "logger=none", "hydra.sweep.dir=s", kill)
    finish(start(tmp_path, "train", *words, *RAY, "seed=0,1,2"))
    assert (tmp_path / "killed").exists()
    assert [job["status"] for job in jobs(tmp_path)] == ["ok"] * 3
    weights = [tmp_path / f"s/{i}/export/model.safetensors" for i in range(3)]
    kept = [(path.stat().st_mtime_ns, path.read_bytes()) for path in weights]

    said = finish(start(tmp_path, "train", *words, *RAY, "seed=0,1,2"))
    assert "was finished by an earlier run" in said  # Ray shows lines that are alike once
    assert [(path.stat().st_mtime_ns, path.read_bytes()) for path in weights] == kept

    finish(start(tmp_path, "train", *words[:-2], "seed=1", "hydra.sweep.dir=undisturbed"))
    assert (tmp_path / "undisturbed/0/export/model.safetensors").read_bytes() == kept[1][1]


@pytest.mark.long
@pytest.mark.skipif(not importlib.util.find_spec("ray") or sys.platform != "linux", reason="needs Ray, and /proc")
def test_a_preparation_whose_worker_is_killed_loses_nothing_and_makes_nothing_twice(tmp_path):
    write_toys(tmp_path / "toys", 30, 3)
    store = Store(tmp_path / "store")
    words = (*RAY, "shards=3", "shard=0,1,2", "hydra.sweep.dir=s", "model=mlp", "descriptor.k=60", "data.basis_k=60")
    sweep = start(tmp_path, "prepare", *words)
    assert kill_worker(b"ray::_run_job", store.root, lambda: len(store.files()) > 3, 900), sweep.communicate()
    kept = {path: path.stat().st_mtime_ns for path in store.files()}
    assert 3 < len(kept) < 60
    sweep.communicate(timeout=1800)
    finish(start(tmp_path, "prepare", *words))
    assert [job["made"] for job in jobs(tmp_path)] == ["0", "0", "0"] or sweep.returncode != 0
    sound, faults = store.check()
    assert faults == []
    assert [entry.kind for entry in sound].count("descriptor") == [entry.kind for entry in sound].count("lbo") == 30
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
