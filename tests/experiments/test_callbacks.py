from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from lightning.pytorch.callbacks import EarlyStopping, ModelCheckpoint

from csm.errors import ConfigError, NumericalError
from csm.evaluation import evaluate
from csm.experiments.callbacks import EpochLines, FiniteLoss, ValidationErrors, require_monitored
from csm.learning.loading import LightningData
from csm.matching.network import NetworkMethod
from tests.learning.toys import make, train
from tests.toyset import toy_datamodule


@pytest.fixture(scope="module")
def loaded(tmp_path_factory) -> LightningData:
    made = LightningData(toy_datamodule(tmp_path_factory.mktemp("callbacks")))
    made.prepare_data()
    return made


def test_the_validation_errors_are_those_of_the_network_by_the_protocol(loaded, tmp_path):
    errors, module = ValidationErrors(pairs=4, points=50, seed=2), make(loaded)
    trainer = train(module, loaded, tmp_path, 2, callbacks=[errors])
    assert errors.protocol.describe().startswith("4 pairs (drawn with seed 2")
    shapes = loaded.data.validation_shapes()
    (alone,) = evaluate(NetworkMethod(module), shapes, errors.protocol, store=loaded.data.store, workers=0)
    np.testing.assert_allclose(errors.latest.errors, alone.errors, atol=1e-6)
    assert trainer.callback_metrics["fit/age"] == pytest.approx(alone.summary["age"], abs=1e-6)
    assert trainer.callback_metrics["fit/exact"] == pytest.approx(alone.summary["exact"])


def test_numbers_of_held_out_shapes_are_called_so(tmp_path, capsys):
    made = LightningData(toy_datamodule(tmp_path, holdout=2))
    made.prepare_data()
    callbacks = [ValidationErrors(pairs=2, points=20), EpochLines()]
    trainer = train(make(made), made, tmp_path, 1, callbacks=callbacks)
    assert {"val/loss", "val/age", "val/exact", "val/far"} <= set(trainer.callback_metrics)
    assert not any(name.startswith("fit/") for name in trainer.callback_metrics)
    said = capsys.readouterr().out
    assert "val/age" in said
    assert "fitted" not in said


def mirrored(data):
    """Give the shapes a flipped template that takes every point to the place of another."""
    for name in data.train_names():
        shape = data.shape(name)
        data._shapes[name] = replace(shape, mirror=replace(shape.truth, indices=np.roll(shape.truth.indices, 40)))
    return data


def test_far_misses_and_flips_are_counted(tmp_path):
    made = LightningData(mirrored(toy_datamodule(tmp_path, holdout=2)))
    made.prepare_data()
    errors, module = ValidationErrors(pairs=2, points=50), make(made)
    trainer = train(module, made, tmp_path, 1, callbacks=[errors])
    shapes = made.data.validation_shapes()
    (alone,) = evaluate(NetworkMethod(module), shapes, errors.protocol, store=made.data.store, workers=0)
    assert trainer.callback_metrics["val/far"] == pytest.approx((alone.errors > 0.1).mean())
    assert 0 < trainer.callback_metrics["val/flip"] < 1
    assert trainer.callback_metrics["val/flip"] == pytest.approx(alone.summary["flip_rate"])


def test_a_set_that_knows_no_mirror_image_has_no_flips(loaded, tmp_path):
    trainer = train(make(loaded), loaded, tmp_path, 1, callbacks=[ValidationErrors(pairs=2, points=20)])
    assert "fit/far" in trainer.callback_metrics
    assert "fit/flip" not in trainer.callback_metrics


def test_waiting_for_errors_that_are_not_measured_is_refused(loaded, tmp_path):
    stop = EarlyStopping(monitor="val/age")
    with pytest.raises(ConfigError, match=r"monitor=val/age.*also fitted; .*data\.holdout=10\), or monitor fit/age"):
        require_monitored([ModelCheckpoint(), stop], loaded.data)
    require_monitored([stop], toy_datamodule(tmp_path, holdout=2))
    require_monitored([EarlyStopping(monitor="train/loss")], loaded.data)


def test_a_single_validation_shape_has_no_pair_and_ends_no_training(tmp_path):
    made = LightningData(toy_datamodule(tmp_path, holdout=1))
    made.prepare_data()
    errors = ValidationErrors()
    trainer = train(make(made), made, tmp_path, 1, callbacks=[errors])
    assert "val/age" not in trainer.callback_metrics
    assert "val/loss" in trainer.callback_metrics
    assert errors.latest is None


def test_the_check_before_a_training_is_not_measured(loaded, tmp_path):
    errors = ValidationErrors(pairs=1, points=5)
    train(make(loaded), loaded, tmp_path, 1, callbacks=[errors], num_sanity_val_steps=2, limit_train_batches=0)
    assert errors.latest is None


def test_a_line_per_epoch_shows_the_numbers_of_the_bar(loaded, tmp_path, capsys):
    callbacks = [ValidationErrors(pairs=2, points=20), EpochLines()]
    trainer = train(make(loaded), loaded, tmp_path, 3, callbacks=callbacks, check_val_every_n_epoch=2)
    said = capsys.readouterr()
    lines = [line for line in said.out.splitlines() if line.startswith("epoch")]
    assert [line.partition(":")[0] for line in lines] == ["epoch 1 of 3", "epoch 2 of 3", "epoch 3 of 3"]
    assert ["fit/age" in line for line in lines] == [False, True, False]
    assert ["(fit/ is of shapes that are also fitted)" in line for line in lines] == [False, True, False]
    assert lines[2].endswith(f"train/loss {trainer.callback_metrics['train/loss']:.4g}")
    assert "\r" not in said.out + said.err


def test_a_terminal_has_a_bar_and_no_lines(loaded, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    train(make(loaded), loaded, tmp_path, 1, callbacks=[EpochLines()])
    assert "epoch" not in capsys.readouterr().out


def test_validation_leaves_training_as_it_was(loaded, tmp_path):
    weights = []
    for callbacks in ([], [ValidationErrors(pairs=2, points=20)]):
        module = make(loaded)
        train(module, loaded, tmp_path, 2, callbacks=callbacks)
        weights.append(module.network.embed.weight.detach().clone())
    torch.testing.assert_close(*weights)


class Late:
    """A loss that is on its way from a device."""

    def __init__(self, value: float, there: bool) -> None:
        self.where, self.there, self._value = "in epoch 1, step 2 (shape toy0)", there, value

    def is_there(self) -> bool:
        return self.there

    def value(self) -> float:
        return self._value


def test_a_loss_is_looked_at_when_it_is_there_and_at_the_end_in_any_case():
    finite = FiniteLoss()
    trainer = SimpleNamespace(optimizers=[SimpleNamespace(param_groups=[{"lr": 0.1}])], current_epoch=0)
    finite.pending.extend([Late(1.0, True), Late(float("nan"), False)])
    step = (trainer, None, {"loss": torch.tensor(1.0)}, SimpleNamespace(name="toy1"), 2)
    finite.on_train_batch_end(*step)
    assert [one.is_there() for one in finite.pending] == [False, True]
    finite.pending[0].there = True
    with pytest.raises(NumericalError, match=r"the loss is nan in epoch 1, step 2 \(shape toy0\)"):
        finite.on_train_batch_end(*step)
    finite.pending.appendleft(Late(float("inf"), False))
    with pytest.raises(NumericalError, match="the loss is inf"):
        finite.on_train_epoch_end(trainer, None)
