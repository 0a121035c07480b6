from __future__ import annotations

from collections import Counter
from dataclasses import replace
from datetime import timedelta
from functools import partial

import lightning as L
import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from lightning.pytorch.loggers import CSVLogger
from omegaconf import OmegaConf

from csm.commands.choices import config_folder
from csm.data.base import DataModule
from csm.descriptors.base import record
from csm.errors import ConfigError, DataError
from csm.experiments.callbacks import EpochLines, ValidationErrors
from csm.experiments.tensorboard import TensorBoardPanels
from csm.experiments.training import Training, default_callbacks, fit, last_checkpoint, make_module
from csm.matching.network import NetworkMethod, load_model
from tests.experiments.toys import a_training
from tests.learning.toys import NETWORK, QUICK
from tests.shapes import blob
from tests.toyset import toy_datamodule


def visible(folder):
    return {path.name for path in folder.iterdir() if not path.name.startswith(".")}


def test_a_training_leaves_a_checkpoint_an_export_and_its_numbers(tmp_path):
    training = a_training(tmp_path, 2, callbacks=[ValidationErrors(pairs=2, points=20)])
    trained = fit(training, tmp_path / "run")
    assert trained.checkpoint == tmp_path / "run/model.ckpt"
    assert {p.name for p in (tmp_path / "run").iterdir() if p.name != ".csm.lock"} == {
        "model.ckpt",
        "export",
        "checkpoints",
    }
    assert last_checkpoint(tmp_path / "run").is_file()
    assert {"train/loss", "fit/loss", "fit/age", "fit/exact"} <= set(trained.measured)
    assert trained.seconds > 0
    store = training.data.store
    wanted = NetworkMethod(trained.module).describe(blob(2), store).features
    for path in (trained.checkpoint, tmp_path / "run/export/model.json"):
        torch.testing.assert_close(load_model(path).describe(blob(2), store).features, wanted, rtol=0, atol=0)
    assert load_model(trained.checkpoint).key == NetworkMethod(trained.module).key


def test_a_checkpoint_knows_how_it_came_about(tmp_path):
    training = a_training(tmp_path, seed=5)
    known = load_model(fit(training, tmp_path / "run").checkpoint).module.settings
    assert known["descriptor"] == record(training.data.recipe.descriptor)
    assert (known["network"], known["basis_k"], known["lr"]) == (NETWORK, 24, 1e-2)
    about = known["training"]
    assert (about["name"], about["set"], about["seed"], about["epochs"]) == ("toy", "toys", 5, 1)
    assert about["protocol"] == training.data.protocol
    assert about["command"]
    assert about["commit"]


def test_a_mesh_is_read_and_the_preparation_called_once(tmp_path, monkeypatch):
    training = a_training(tmp_path, 2, callbacks=default_callbacks())
    read, prepared = Counter(), []
    load, prepare = type(training.data.train_set).load, DataModule.prepare

    def counting(shapes, name):
        read[name] += 1
        return load(shapes, name)

    monkeypatch.setattr(type(training.data.train_set), "load", counting)
    monkeypatch.setattr(DataModule, "prepare", lambda data: prepared.append(1) or prepare(data))
    fit(training, tmp_path / "run")
    assert read == dict.fromkeys(training.data.fit_names, 1)
    assert prepared == [1]


def test_without_callbacks_and_log_nothing_else_is_written(tmp_path, capsys):
    fit(a_training(tmp_path), tmp_path / "run")
    assert {p.name for p in (tmp_path / "run").iterdir() if p.name != ".csm.lock"} == {
        "model.ckpt",
        "export",
        "checkpoints",
    }
    assert "epoch" not in capsys.readouterr().out


def test_a_log_is_kept_where_it_is_asked_for(tmp_path):
    logger = partial(CSVLogger, name="csv", version="")
    fit(a_training(tmp_path, logger=logger), tmp_path / "run")
    assert (tmp_path / "run/csv/metrics.csv").is_file()


def test_a_training_goes_on_from_its_last_epoch(tmp_path):
    first = fit(a_training(tmp_path, 1), tmp_path / "run")
    again = fit(a_training(tmp_path, 3), tmp_path / "run", last_checkpoint(tmp_path / "run"))
    assert (first.module.hparams["training"]["epochs"], again.module.hparams["training"]["epochs"]) == (1, 3)
    state = torch.load(again.checkpoint, weights_only=True)
    assert (state["epoch"], state["global_step"]) == (3, 12)


def test_fewer_epochs_than_are_done_are_refused_and_none_at_all_are_said(tmp_path, caplog):
    fit(a_training(tmp_path, 2), tmp_path / "run")
    once = a_training(tmp_path, 1)
    with pytest.raises(ConfigError, match=r"last\.ckpt: 2 epochs are done there, trainer\.max_epochs=1 wants fewer"):
        fit(once, tmp_path / "run")
    assert not caplog.records
    fit(a_training(tmp_path, 0), tmp_path / "none")
    assert "nothing is trained" in caplog.text


def test_a_limit_of_time_ends_a_training_and_the_checkpoint_says_after_how_many_epochs(tmp_path):
    trainer = partial(L.Trainer, **(QUICK | {"max_epochs": 99_999, "max_time": timedelta(seconds=1)}))
    trained = fit(a_training(tmp_path, trainer=trainer), tmp_path / "run")
    assert 0 < load_model(trained.checkpoint).training["epochs"] < 9999


def test_the_seed_decides_everything(tmp_path):
    weights = [
        fit(a_training(tmp_path, seed=seed), tmp_path / str(i)).module.network.embed.weight.detach()
        for i, seed in enumerate((0, 0, 1))
    ]
    torch.testing.assert_close(weights[0], weights[1])
    assert not torch.allclose(weights[0], weights[2])


def test_settings_that_do_not_fit_are_errors_of_the_user(tmp_path):
    two = partial(L.Trainer, **(QUICK | {"devices": 2}))
    with pytest.raises(ConfigError, match=r"trainer\.devices=2, .*several devices train together with trainer=ddp"):
        fit(a_training(tmp_path, trainer=two), tmp_path / "run")
    with pytest.raises(ConfigError, match=r"trainer\.precision=64-true: .*wanted 32-true"):
        fit(a_training(tmp_path, trainer=partial(L.Trainer, **(QUICK | {"precision": "64-true"}))), tmp_path / "run")
    with pytest.raises(ConfigError, match=r"data\.basis_k=64"):
        fit(a_training(tmp_path, network=NETWORK | {"ks": 64}), tmp_path / "run")
    with pytest.raises(ConfigError, match="descriptor=xyz"):
        fit(a_training(tmp_path, options={"rotate": True}), tmp_path / "run")


def test_training_shapes_that_cannot_be_used_are_listed(tmp_path):
    training = a_training(tmp_path)
    (tmp_path / "toys/toy2.off").write_text("OFF\n3 1 0\n0 0 0\n")
    with pytest.raises(DataError, match=r"1 of 4 shapes cannot be used:\ntoys/toy2 "):
        fit(training, tmp_path / "run")
    assert not (tmp_path / "run/model.ckpt").exists()


def test_the_default_callbacks_are_those_of_the_command(tmp_path):
    errors, panels, lines = default_callbacks(seed=7)
    assert isinstance(errors, ValidationErrors)
    assert errors.protocol.seed == 7
    assert (type(panels), type(lines)) == (TensorBoardPanels, EpochLines)
    one, other = (Training("a", None, NETWORK).callbacks for _ in range(2))  # type: ignore[arg-type]
    assert one[0] is not other[0]


def test_a_module_is_made_for_the_shapes_of_the_data(tmp_path):
    training = a_training(tmp_path)
    made = make_module(training, n_features=16, epochs=9)
    assert made.network.classifier.weight.shape[0] == training.data.n_classes == 162
    assert made.hparams["training"]["epochs"] == 9
    assert np.isclose(made.lr, 1e-2)


def test_a_step_over_two_shapes_is_counted_and_scheduled_once(tmp_path):
    """Three shapes are two steps, the second over one; the rate of one cycle ends where the training does."""
    how = {"max_epochs": 3, "accumulate_grad_batches": 2}
    data, options = toy_datamodule(tmp_path, holdout=1), {"lr": 1e-2, "schedule": "one_cycle"}
    training = a_training(tmp_path, data=data, options=options, trainer=partial(L.Trainer, **(QUICK | how)))
    trained = fit(training, tmp_path / "run")
    state = torch.load(trained.checkpoint, weights_only=True)
    assert state["global_step"] == state["lr_schedulers"][0]["last_epoch"] == 3 * 2
    assert state["lr_schedulers"][0]["total_steps"] == 3 * 2 + 1
    assert trained.module.hparams["training"]["shapes_per_step"] == 2


def test_the_loss_that_is_logged_is_that_of_a_shape_whatever_a_step_takes(tmp_path):
    data = toy_datamodule(tmp_path)
    logged = []
    for many in (1, 4):
        trainer = partial(L.Trainer, **(QUICK | {"max_epochs": 1, "accumulate_grad_batches": many}))
        training = a_training(tmp_path, data=data, options={"lr": 0.0}, trainer=trainer)
        logged.append(fit(training, tmp_path / str(many)).measured["train/loss"])
    assert logged[0] == pytest.approx(logged[1])


def test_a_training_of_several_shapes_per_step_goes_on_as_if_it_had_not_been_stopped(tmp_path):
    data = toy_datamodule(tmp_path)

    def of(epochs, many=2):
        trainer = partial(L.Trainer, **(QUICK | {"max_epochs": epochs, "accumulate_grad_batches": many}))
        return a_training(tmp_path, data=data, trainer=trainer, network=NETWORK | {"dropout": 0.3})

    whole = fit(of(4), tmp_path / "whole").module.state_dict()
    fit(of(2), tmp_path / "cut")
    with pytest.raises(ConfigError, match=r"training\.shapes_per_step: 2 there, 1 wanted"):
        fit(of(4, 1), tmp_path / "cut")
    torch.testing.assert_close(fit(of(4), tmp_path / "cut").module.state_dict(), whole, rtol=0, atol=0)


def test_what_the_trainer_makes_of_a_step_is_a_setting_too(tmp_path):
    def of(**how):
        return a_training(tmp_path, data=data, trainer=partial(L.Trainer, **(QUICK | {"max_epochs": 2} | how)))

    data = toy_datamodule(tmp_path)
    fit(of(limit_train_batches=1), tmp_path / "few")
    fit(of(limit_train_batches=1), tmp_path / "few")
    with pytest.raises(ConfigError, match=r"trainer\.limit_train_batches: 1 there, None wanted"):
        fit(of(), tmp_path / "few")
    fit(of(), tmp_path / "all")
    with pytest.raises(ConfigError, match=r"trainer\.gradient_clip_val: None there, 0\.1 wanted"):
        fit(of(gradient_clip_val=0.1), tmp_path / "all")


def test_a_logger_whose_library_is_missing_is_said_in_a_sentence(tmp_path):
    def missing(save_dir):
        raise ModuleNotFoundError("No module named 'wandb'")

    with pytest.raises(
        ConfigError, match=r'logger: a library is not installed; pip install "csm-correspondence\[wandb\]"'
    ):
        fit(a_training(tmp_path, logger=missing), tmp_path / "run")


@pytest.mark.parametrize("name", ["wandb", "mlflow"])
def test_other_loggers_write_on_this_machine(tmp_path, monkeypatch, name):
    pytest.importorskip(name, reason=f'needs pip install "csm-correspondence[{name}]"')
    monkeypatch.chdir(tmp_path)
    logger = instantiate(OmegaConf.load(config_folder() / "logger" / f"{name}.yaml"), _partial_=True)
    fit(a_training(tmp_path, logger=logger), tmp_path / "run")
    assert any(name in path.name for path in tmp_path.rglob("*"))


def test_a_training_begins_with_the_weights_of_another(tmp_path):
    first = fit(a_training(tmp_path, 2), tmp_path / "first")
    still = a_training(tmp_path, options={"lr": 0.0}, pretrained=str(first.checkpoint))
    again = fit(still, tmp_path / "again").module
    for name, weights in first.module.network.named_parameters():
        torch.testing.assert_close(again.network.get_parameter(name), weights, rtol=0, atol=0)
    known = again.hparams["training"]["pretrained"]
    assert {key: known[key] for key in ("name", "set", "epochs")} == {"name": "toy", "set": "toys", "epochs": 2}
    other = fit(a_training(tmp_path, 2, seed=1), tmp_path / "other")
    with pytest.raises(ConfigError, match=r"training\.pretrained\.weights"):
        fit(replace(still, pretrained=str(other.checkpoint)), tmp_path / "again")


def test_a_network_that_does_not_fit_is_refused_before_the_preparation(tmp_path, monkeypatch):
    first = fit(a_training(tmp_path), tmp_path / "first")
    monkeypatch.setattr(DataModule, "prepare", lambda data: pytest.fail("prepared"))
    wider = NETWORK | {"descriptor_channels": 32}
    with pytest.raises(ConfigError, match="the model is another one"):
        fit(a_training(tmp_path, network=wider, pretrained=str(first.checkpoint)), tmp_path / "run")
    with pytest.raises(DataError, match="nowhere: there is no such checkpoint"):
        fit(a_training(tmp_path, pretrained="nowhere"), tmp_path / "run")
