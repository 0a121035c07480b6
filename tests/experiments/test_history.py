"""What a training has kept of its way is what was measured, also where it was interrupted."""

from __future__ import annotations

from functools import partial

import lightning as L
import pytest

from csm.experiments.callbacks import ValidationErrors
from csm.experiments.training import fit
from tests.experiments.toys import a_training
from tests.learning.toys import QUICK
from tests.toyset import toy_datamodule


def of(folder, epochs):
    trainer = partial(L.Trainer, **(QUICK | {"max_epochs": epochs, "check_val_every_n_epoch": 2}))
    data, callbacks = toy_datamodule(folder, holdout=2), [ValidationErrors(pairs=2, points=20)]
    return a_training(folder, data=data, trainer=trainer, callbacks=callbacks)


def test_every_epoch_has_a_loss_and_every_validation_its_errors_also_after_an_interruption(tmp_path):
    whole = fit(of(tmp_path, 4), tmp_path / "whole")
    epochs = {name: [epoch for epoch, _ in curve] for name, curve in whole.curves.items()}
    validated = ("val/loss", "val/age", "val/exact", "val/far")
    assert epochs == {"train/loss": [1, 2, 3, 4], **{name: [2, 4] for name in validated}}
    assert {name: curve[-1][1] for name, curve in whole.curves.items()} == pytest.approx(dict(whole.measured))
    fit(of(tmp_path, 2), tmp_path / "cut")
    again = fit(of(tmp_path, 4), tmp_path / "cut").curves
    for name, curve in whole.curves.items():
        assert again[name] == [(epoch, pytest.approx(value)) for epoch, value in curve]


def test_a_training_that_was_finished_has_its_numbers_and_seconds_when_it_is_started_again(tmp_path):
    first = fit(of(tmp_path, 2), tmp_path / "run")
    again = fit(of(tmp_path, 2), tmp_path / "run")
    assert dict(again.measured) == pytest.approx(dict(first.measured))
    assert again.seconds >= 0.9 * first.seconds > 0
