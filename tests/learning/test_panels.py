from __future__ import annotations

import math

import pytest
from lightning.pytorch.loggers import TensorBoardLogger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from csm.learning.callbacks import ValidationErrors
from csm.learning.panels import TensorBoardPanels, flatten
from tests.learning.test_module import make, train
from tests.toyset import toy_datamodule


@pytest.fixture(scope="module")
def events(tmp_path_factory) -> EventAccumulator:
    folder = tmp_path_factory.mktemp("panels")
    datamodule = toy_datamodule(folder)
    datamodule.prepare_data()
    errors = ValidationErrors(pairs=2, points=50)
    callbacks = [errors, TensorBoardPanels(errors, {"model": {"ks": 20}, "seed": 3})]
    logger = TensorBoardLogger(folder, name="tb", version="", default_hp_metric=False)
    train(make(datamodule), datamodule, folder, 2, logger=logger, callbacks=callbacks)
    return EventAccumulator(str(folder / "tb"), size_guidance={"tensors": 0, "images": 0, "scalars": 0}).Reload()


def test_losses_and_validation_errors_are_scalars(events):
    names = set(events.Tags()["scalars"])
    assert {"train/loss", "val/loss", "val/age", "val/exact"} <= names


def test_hparams_are_filled_in_at_the_end(events):
    values = [event.value for event in events.Scalars("hp/val/age")]
    assert math.isnan(values[0])
    assert 0 <= values[-1] < 1


def test_curve_filters_and_a_map_are_pictures(events):
    assert {"val/cqc", "filters", "maps/validation"} <= set(events.Tags()["images"])


def test_the_protocol_is_a_text(events):
    (event,) = events.Tensors("protocol/text_summary")
    text = event.tensor_proto.string_val[0].decode()
    assert "split toys" in text
    assert "heat method" in text


def test_flatten_keeps_scalars_and_writes_lists_as_text():
    assert flatten({"a": {"b": 1.5, "c": None}, "d": [1]}) == {"a.b": 1.5, "a.c": "None", "d": "[1]"}
