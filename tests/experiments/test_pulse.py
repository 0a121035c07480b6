from __future__ import annotations

import math
from functools import partial

import lightning as L
import pytest
import torch

from csm.experiments.pulse import Pulse, peak_memory
from tests.experiments.test_tensorboard import logged
from tests.learning.toys import QUICK

NAMES = ["step/learning_rate", "step/gradient_norm", "step/seconds", "step/memory_mb"]


@pytest.fixture(scope="module")
def events(tmp_path_factory):
    trainer = partial(L.Trainer, **(QUICK | {"max_epochs": 2, "log_every_n_steps": 1}))
    return logged(tmp_path_factory.mktemp("pulse"), callbacks=[Pulse()], trainer=trainer)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_logged_in_every_step_with_values_that_make_sense(events, name):
    values = [event.value for event in events.Scalars(name)]
    assert len(values) == 8
    assert all(math.isfinite(value) and value > 0 for value in values)


def test_the_learning_rate_is_that_of_the_steps(events):
    assert [event.value for event in events.Scalars("step/learning_rate")] == pytest.approx([1e-2] * 8)


def test_memory_of_the_process_grows_with_what_it_holds():
    before = peak_memory(torch.device("cpu"))
    held = torch.ones(64, 2**20)
    assert peak_memory(torch.device("cpu")) >= before
    assert held.sum() == held.numel()
