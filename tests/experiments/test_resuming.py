from __future__ import annotations

import os
import signal
from functools import partial

import lightning as L
import numpy as np
import pytest
import torch

from csm._locks import locked
from csm._signals import Terminated
from csm.errors import ConfigError, DataError, NumericalError
from csm.experiments.callbacks import ValidationErrors
from csm.experiments.resuming import last_checkpoint, require_same_settings, resume_point
from csm.experiments.training import fit, make_module
from csm.matching.network import load_model
from tests.experiments.toys import a_training
from tests.learning.toys import NETWORK, QUICK

EPOCHS = 4
RANDOM = {"network": NETWORK | {"dropout": 0.3}, "options": {"lr": 1e-2, "loss_rows": 40, "schedule": "one_cycle"}}


class Kill(L.Callback):
    """Send this process a signal in the middle of an epoch."""

    def __init__(self, epoch: int, number: int = signal.SIGTERM) -> None:
        self.epoch, self.number = epoch, number

    def on_train_batch_start(self, trainer, pl_module, batch, batch_idx):
        if (trainer.current_epoch, batch_idx) == (self.epoch, 1):
            os.kill(os.getpid(), self.number)


def training(folder, *callbacks):
    trainer = partial(L.Trainer, **(QUICK | {"max_epochs": EPOCHS, "check_val_every_n_epoch": 2}))
    return a_training(folder, trainer=trainer, callbacks=[ValidationErrors(pairs=2, points=20), *callbacks], **RANDOM)


def weights(path):
    return torch.load(path, weights_only=True)["state_dict"]


@pytest.fixture
def stopping():
    before = signal.signal(signal.SIGTERM, _stop)
    yield
    signal.signal(signal.SIGTERM, before)


def _stop(number, frame):
    raise Terminated


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    return fit(training(folder), folder / "run")


@pytest.mark.parametrize("killed_in", [1, 2])
def test_a_training_that_was_stopped_ends_as_one_that_was_not(tmp_path, stopping, whole, killed_in):
    with pytest.raises(Terminated, match=f"{killed_in} of {EPOCHS} epochs are done"):
        fit(training(tmp_path, Kill(killed_in)), tmp_path / "cut")
    np.random.seed(99)  # noqa: NPY002 - the states are those of the checkpoint, not of this process
    again = fit(training(tmp_path), tmp_path / "cut")
    kept, wanted = weights(again.checkpoint), weights(whole.checkpoint)
    assert all(torch.equal(kept[name], wanted[name]) for name in wanted)
    assert {k: again.measured[k] for k in ("fit/age", "train/loss")} == {
        k: whole.measured[k] for k in ("fit/age", "train/loss")
    }


def test_ctrl_c_says_what_is_kept_and_leaves_the_next_ctrl_c_alone(tmp_path):
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt, match=r"no epoch was finished"):
        fit(training(tmp_path, Kill(0, signal.SIGINT)), tmp_path / "run")
    assert signal.getsignal(signal.SIGINT) is before


def test_a_checkpoint_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch, whole):
    last = last_checkpoint(tmp_path / "run")
    last.parent.mkdir(parents=True)
    last.write_bytes(whole.checkpoint.read_bytes())
    before = last.read_bytes()

    def cut(checkpoint, file):
        file.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(torch, "save", cut)
    trainer = partial(L.Trainer, **(QUICK | {"max_epochs": EPOCHS}))
    with pytest.raises((OSError, DataError), match=r"(?i)space|full"):
        fit(a_training(tmp_path, trainer=trainer, **RANDOM), tmp_path / "run", resume=None)
    assert last.read_bytes() == before
    assert [p.name for p in last.parent.iterdir()] == ["last.ckpt"]


def test_a_damaged_checkpoint_is_named_and_the_training_begins_again(tmp_path, caplog):
    last = last_checkpoint(tmp_path)
    assert resume_point(tmp_path, "auto") is None
    last.parent.mkdir()
    for content in (b"", b"PK\x03\x04 cut"):
        last.write_bytes(content)
        assert resume_point(tmp_path, "auto") is None
        assert "last.ckpt" in caplog.text
        with pytest.raises(DataError, match=r"last\.ckpt"):
            resume_point(tmp_path, last)
    assert resume_point(tmp_path, None) is None


def test_other_settings_are_refused_with_what_differs(tmp_path, whole):
    path = whole.checkpoint
    one = training(tmp_path)
    require_same_settings(path, make_module(one, 16, EPOCHS), EPOCHS)
    with pytest.raises(ConfigError, match=r"trainer\.max_epochs, over which the schedule is laid out: 4 there, 9 w"):
        require_same_settings(path, make_module(one, 16, 9), 9)
    other = a_training(tmp_path, network=NETWORK | {"ks": 12, "dropout": 0.3}, options=RANDOM["options"], seed=1)
    with pytest.raises(ConfigError, match=r"network\.ks: \d+ there, 12 wanted; training\.seed: 0 there, 1 wanted"):
        require_same_settings(path, make_module(other, 16, EPOCHS), EPOCHS)


def test_an_export_is_not_gone_on_from(tmp_path):
    with pytest.raises(DataError, match=r"an export has the weights alone.*pretrained=.*model\.json begins another"):
        resume_point(tmp_path, tmp_path / "export" / "model.json")


def test_two_trainings_in_one_folder_are_refused(tmp_path):
    (tmp_path / "run").mkdir()
    with locked(tmp_path / "run", wait=0), pytest.raises(ConfigError, match="another run of csm"):
        fit(training(tmp_path), tmp_path / "run")


def test_a_loss_that_is_no_number_ends_the_training_where_it_happens(tmp_path):
    wild = a_training(tmp_path, 3, options={"lr": 1e30})
    with pytest.raises(
        NumericalError, match=r"diverged: the loss is \S+ in epoch 1, step \d+ \(shape toy\d\).*optimizer\.lr"
    ):
        fit(wild, tmp_path / "run")


def test_a_foreign_file_is_refused_without_advice_to_run_its_code(tmp_path):
    torch.save({"state_dict": {}, "hyper_parameters": Kill(1)}, tmp_path / "foreign.ckpt")
    with pytest.raises(DataError, match=r"foreign\.ckpt: not a checkpoint of csm") as refused:
        load_model(tmp_path / "foreign.ckpt")
    assert "weights_only" not in str(refused.value)
    for odd in ({"network": "csmcnn"}, {"network": {"name": 3}}, [], {"network": {"name": "csmcnn"}, "descriptor": 4}):
        torch.save({"state_dict": {}, "hyper_parameters": odd}, tmp_path / "odd.ckpt")
        with pytest.raises(DataError, match=r"odd\.ckpt: not a checkpoint of csm"):
            load_model(tmp_path / "odd.ckpt")
