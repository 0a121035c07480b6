from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import pytest
from lightning.pytorch.loggers import TensorBoardLogger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from csm.experiments.callbacks import ValidationErrors
from csm.experiments.tensorboard import TensorBoardPanels, flatten
from csm.experiments.training import fit
from tests.experiments.toys import a_training


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
    assert {"train/loss", "val/loss", "val/age", "val/exact"} <= set(events.Tags()["scalars"])


def test_hparams_are_filled_in_at_the_end(events):
    values = [event.value for event in events.Scalars("hp/val/age")]
    assert math.isnan(values[0])
    assert 0 <= values[-1] < 1
    assert events.Scalars("hp/train/loss")[-1].value == pytest.approx(events.Scalars("train/loss")[-1].value)


def test_curve_filters_and_a_map_are_pictures(events):
    assert {"val/cqc", "filters", "maps/validation"} <= set(events.Tags()["images"])
    assert len(events.Images("val/cqc")) == 2


def test_the_protocol_is_a_text(events):
    (event,) = events.Tensors("protocol/text_summary")
    text = event.tensor_proto.string_val[0].decode()
    assert "split toys" in text
    assert "heat method" in text


def test_without_validation_errors_the_other_panels_are_there(tmp_path):
    events = logged(tmp_path, callbacks=[TensorBoardPanels()])
    tags = events.Tags()
    assert {"filters", "maps/validation"} <= set(tags["images"])
    assert "val/cqc" not in tags["images"]
    (event,) = events.Tensors("protocol/text_summary")
    assert b"heat" not in event.tensor_proto.string_val[0]


def test_without_a_tensorboard_log_panels_do_nothing(tmp_path):
    fit(a_training(tmp_path, callbacks=[TensorBoardPanels({"a": 1})]), tmp_path / "run")
    assert {p.name for p in (tmp_path / "run").iterdir() if p.name[0] != "."} == {"model.ckpt", "export", "checkpoints"}


def test_flatten_keeps_scalars_and_writes_lists_as_text():
    assert flatten({"a": {"b": 1.5, "c": None}, "d": [1]}) == {"a.b": 1.5, "a.c": "None", "d": "[1]"}
