from __future__ import annotations

import sys
from functools import partial

import lightning as L
import pytest
from lightning.pytorch.callbacks import ProgressBar

from csm.experiments.tensorboard import TensorBoardPanels
from csm.experiments.trainer import make_trainer, shapes_per_step
from tests.experiments.toys import a_training
from tests.learning.toys import QUICK


def test_panels_get_the_settings_of_the_training_unless_they_have_some(tmp_path):
    empty, own = TensorBoardPanels(), TensorBoardPanels({"mine": 1})
    make_trainer(a_training(tmp_path, callbacks=[empty, own], settings={"seed": 3}), tmp_path)
    assert (empty.hparams, own.hparams) == ({"seed": 3}, {"mine": 1})


@pytest.mark.parametrize(("terminal", "wanted", "bar"), [(1, 1, 1), (0, 1, 0), (1, 0, 0), (0, 0, 0)])
def test_a_bar_is_for_terminals(tmp_path, monkeypatch, terminal, wanted, bar):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: bool(terminal))
    trainer = partial(L.Trainer, **(QUICK | {"enable_progress_bar": bool(wanted)}))
    made = make_trainer(a_training(tmp_path, trainer=trainer), tmp_path)
    assert isinstance(made.progress_bar_callback, ProgressBar) == bool(bar)


def test_a_step_is_over_all_shapes_whose_gradients_are_gathered(tmp_path):
    trainer = partial(L.Trainer, **(QUICK | {"accumulate_grad_batches": 3}))
    assert shapes_per_step(make_trainer(a_training(tmp_path, trainer=trainer), tmp_path)) == 3
