"""Trainings of a few seconds on the toys."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import lightning as L

from csm.data.folder import FolderDataModule
from csm.experiments.training import Training
from tests.learning.toys import NETWORK, QUICK
from tests.toyset import toy_datamodule


def a_training(folder: Path, epochs: int = 1, data: FolderDataModule | None = None, **changes: Any) -> Training:
    """Return a training without callbacks and log on `write_toys(folder / "toys")`."""
    settings: dict[str, Any] = {
        "name": "toy",
        "data": data or toy_datamodule(folder),
        "network": NETWORK,
        "options": {"lr": 1e-2},
        "trainer": partial(L.Trainer, **(QUICK | {"max_epochs": epochs})),
        "callbacks": (),
    }
    return Training(**(settings | changes))
