"""``csm train trainer=ddp``: the command starts its processes and speaks for them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from types import SimpleNamespace

import lightning as L
import pytest

from csm._locks import locked
from csm.commands.processes import is_first, job_words, processes_to_start, typed_command
from csm.errors import ConfigError
from tests.experiments import two_ranks
from tests.experiments.toys import a_training
from tests.learning.toys import QUICK
from tests.toyset import write_toys

SMALL = (
    *("data=folder", "data.root=toys", "data.n_test=2", "data.basis_k=24", "workers=0", "logger=csv"),
    *("descriptor=acd_paper", "descriptor.angles=4", "descriptor.k=8", "descriptor.order=3"),
    *("model=csmcnn_paper", "model.channels=[16,16]", "model.descriptor_channels=24", "model.ks=20", "model.terms=4"),
    *("trainer=ddp", "trainer.devices=2", "trainer.accelerator=cpu"),
)


def start(folder, *words) -> subprocess.Popen[str]:
    write_toys(folder / "toys")
    command = [sys.executable, "-m", "csm.commands.train", *SMALL, *words]
    environment = os.environ | {"CSM_CACHE": str(folder / "store")}
    return subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.slow
def test_two_processes_train_and_one_of_them_tests(tmp_path):
    ran = start(tmp_path, "trainer.max_epochs=2", "name=a b", "hydra.run.dir=run")
    said, errors = ran.communicate(timeout=900)
    assert ran.returncode == 0, errors
    for once in ("epoch 2 of 2", "trained for", "| a b | nearest | toys", "split toys"):
        assert said.count(once) == 1, said
    assert "Traceback" not in errors
    result = json.loads((tmp_path / "run/result.json").read_text())
    assert result["status"] == "ok"
    assert {"train/loss", "age/toys"} <= result.keys()
    about = json.loads((tmp_path / "run/export/model.json").read_text())["training"]
    assert "'name=a b' hydra.run.dir=run" in about["command"]
    assert about["shapes_per_step"] == 2
    assert (tmp_path / "run/csv/metrics.csv").is_file()
    assert not list((tmp_path / "run").rglob("*rank*"))


@pytest.mark.slow
@pytest.mark.long
def test_a_process_that_fails_ends_all_and_says_why(tmp_path):
    ran = start(tmp_path, "trainer.max_epochs=3", "optimizer.lr=1e30", "hydra.run.dir=run")
    _, errors = ran.communicate(timeout=900)
    assert ran.returncode == 2
    assert "the training has diverged" in errors
    assert "of the 2 processes that train together ended with status 2" in errors
    assert "Traceback" not in errors
    assert not (tmp_path / "run/model.ckpt").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
@pytest.mark.long
def test_sigterm_and_a_kill_end_all_and_the_same_command_goes_on(tmp_path):
    words = ("trainer.max_epochs=400", "hydra.run.dir=run", "test=false")
    ran, last = start(tmp_path, *words), tmp_path / "run/checkpoints/last.ckpt"
    end = time.monotonic() + 900
    while not last.exists() and time.monotonic() < end and ran.poll() is None:
        time.sleep(0.05)
    ran.send_signal(signal.SIGTERM)
    _, errors = ran.communicate(timeout=300)
    assert ran.returncode == 143, errors
    assert "of 400 epochs are done" in errors
    assert "Traceback" not in errors
    again = start(tmp_path, *words)
    first = next(line for line in again.stdout if line.startswith("epoch"))
    again.kill()
    again.communicate(timeout=300)
    with locked(tmp_path / "run", wait=300):  # nobody works there any more
        assert last.exists()
    assert not first.startswith("epoch 1 of")


def test_how_many_processes_a_training_wants(tmp_path, monkeypatch):
    assert processes_to_start(a_training(tmp_path), tmp_path) == 0
    assert processes_to_start(two_ranks.training(tmp_path, 1, 2), tmp_path) == 2
    nodes = partial(L.Trainer, **(QUICK | {"devices": 2, "num_nodes": 3, "strategy": "ranks"}))
    with pytest.raises(ConfigError, match=r"srun --nodes=3 --ntasks-per-node=2 csm train"):
        processes_to_start(a_training(tmp_path, trainer=nodes), tmp_path)
    for name, value in {"RANK": 0, "LOCAL_RANK": 0, "WORLD_SIZE": 2, "TORCHELASTIC_RUN_ID": "x"}.items():
        monkeypatch.setenv(name, str(value))
    assert processes_to_start(two_ranks.training(tmp_path, 1, 2), tmp_path) == 0


def test_the_first_process_speaks(monkeypatch):
    assert is_first()
    monkeypatch.setenv("LOCAL_RANK", "0")
    monkeypatch.setenv("RANK", "4")
    assert not is_first()


def test_a_process_knows_the_command_that_was_typed(monkeypatch):
    assert typed_command() is None
    monkeypatch.setenv("CSM_COMMAND", '["csm train", "seed=1"]')
    assert typed_command() == ["csm train", "seed=1"]


def test_a_job_is_given_on_with_its_options_and_its_folder(tmp_path, monkeypatch):
    sources = [SimpleNamespace(provider=name, path=f"/{name}") for name in ("main", "command-line")]
    overrides = SimpleNamespace(task=["seed=1", "data.root='a b'"])
    hydra = SimpleNamespace(runtime=SimpleNamespace(config_sources=sources), overrides=overrides)
    monkeypatch.setattr("csm.commands.processes.HydraConfig.get", lambda: hydra)
    words = job_words(tmp_path / "it's")
    assert words[:3] == ["seed=1", "data.root='a b'", f"hydra.run.dir='{tmp_path}/it\\'s'"]
    assert words[-2:] == ["--config-dir", "/command-line"]
