from __future__ import annotations

from functools import partial
from pathlib import Path

import lightning as L
import pytest
import torch
from lightning.pytorch.loggers import TensorBoardLogger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.metadata import parse_experiment_plugin_data

from csm.experiments.callbacks import ValidationErrors
from csm.experiments.tensorboard import TensorBoardPanels, flatten, is_due
from csm.experiments.training import fit
from tests.experiments.toys import a_training
from tests.learning.toys import NETWORK, QUICK
from tests.toyset import toy_datamodule

STEPS = [4, 8]
"""Steps at the end of the two epochs of four shapes."""


def logged(folder: Path, **changes: object) -> EventAccumulator:
    """Train with a TensorBoard log and read it."""
    logger = partial(TensorBoardLogger, name="tb", version="", default_hp_metric=False)
    fit(a_training(folder, 2, logger=logger, **changes), folder / "run")
    return EventAccumulator(str(folder / "run/tb"), size_guidance={"tensors": 0, "images": 0, "scalars": 0}).Reload()


@pytest.fixture(scope="module")
def events(tmp_path_factory) -> EventAccumulator:
    callbacks = [ValidationErrors(pairs=2, points=50), TensorBoardPanels()]
    settings = {"model": {"ks": 20}, "seed": 3}
    return logged(tmp_path_factory.mktemp("panels"), callbacks=callbacks, settings=settings)


def test_losses_and_validation_errors_are_scalars(events):
    assert {"train/loss", "fit/loss", "fit/age", "fit/exact", "fit/far"} <= set(events.Tags()["scalars"])


def test_hparams_have_the_final_errors_only(events):
    tags = [tag for tag in events.Tags()["scalars"] if tag.startswith("hp/")]
    assert set(tags) == {"hp/fit/age", "hp/fit/exact", "hp/fit/far", "hp/fit/loss", "hp/train/loss"}
    for tag in tags:
        (event,) = events.Scalars(tag)
        assert event.value == pytest.approx(events.Scalars(tag.removeprefix("hp/"))[-1].value)
        assert event.step == STEPS[-1]


def test_hparams_name_settings_and_results_from_the_beginning(events):
    content = events.summary_metadata["_hparams_/experiment"].plugin_data.content
    experiment = parse_experiment_plugin_data(content)
    assert {info.name for info in experiment.hparam_infos} == {"model.ks", "seed"}
    assert {"hp/fit/age", "hp/fit/flip", "hp/train/loss"} <= {info.name.tag for info in experiment.metric_infos}


def test_curve_filters_and_a_map_are_drawn_after_every_validation(events):
    assert {"fit/cqc", "filters", "fit/map"} == set(events.Tags()["images"])
    for tag in events.Tags()["images"]:
        assert [event.step for event in events.Images(tag)] == STEPS


def test_pictures_of_unseen_shapes_are_called_so_and_the_last_epoch_has_its_own(tmp_path):
    trainer = partial(L.Trainer, **(QUICK | {"max_epochs": 3, "check_val_every_n_epoch": 2}))
    data = toy_datamodule(tmp_path, holdout=1)
    events = logged(tmp_path, callbacks=[TensorBoardPanels()], data=data, trainer=trainer)
    assert [event.step for event in events.Images("val/map")] == [2 * 3, 3 * 3]
    assert "val/loss" in events.Tags()["scalars"]


def test_long_trainings_draw_a_few_pictures():
    drawn = [n for n in range(1, 1001) if is_due(n, 1000, 10)]
    assert drawn == [1, *range(100, 1001, 100)]
    assert [n for n in range(1, 4) if is_due(n, 3, 10)] == [1, 2, 3]


def test_pictures_leave_the_training_as_it_was(tmp_path):
    logger = partial(TensorBoardLogger, name="tb", version="", default_hp_metric=False)
    network = NETWORK | {"dropout": 0.3}
    weights = [
        fit(
            a_training(tmp_path, 2, network=network, callbacks=some, logger=logger), tmp_path / name
        ).module.state_dict()
        for name, some in (("with", [TensorBoardPanels()]), ("without", []))
    ]
    torch.testing.assert_close(*weights, rtol=0, atol=0)


def test_the_protocol_is_a_text(events):
    (event,) = events.Tensors("protocol/text_summary")
    text = event.tensor_proto.string_val[0].decode()
    assert "split toys" in text
    assert "heat method" in text


def test_without_validation_errors_the_other_panels_are_there(tmp_path):
    events = logged(tmp_path, callbacks=[TensorBoardPanels()])
    tags = events.Tags()
    assert {"filters", "fit/map"} <= set(tags["images"])
    assert "fit/cqc" not in tags["images"]
    (event,) = events.Tensors("protocol/text_summary")
    assert b"heat" not in event.tensor_proto.string_val[0]


def test_without_a_tensorboard_log_panels_do_nothing(tmp_path):
    fit(a_training(tmp_path, callbacks=[TensorBoardPanels({"a": 1})]), tmp_path / "run")
    assert {p.name for p in (tmp_path / "run").iterdir() if p.name[0] != "."} == {"model.ckpt", "export", "checkpoints"}


def test_flatten_keeps_scalars_and_writes_lists_as_text():
    assert flatten({"a": {"b": 1.5, "c": None}, "d": [1]}) == {"a.b": 1.5, "a.c": "None", "d": "[1]"}
