"""A small network, and how it is trained on the toys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from lightning import Trainer

from csm.data.base import DataModule
from csm.descriptors.base import record
from csm.learning.loading import LightningData
from csm.learning.module import CSMModule
from csm.learning.samples import also_classes

NETWORK = {"name": "csmcnn", "channels": [16, 16, 16], "descriptor_channels": 24, "ks": 20, "terms": 4, "dropout": 0.0}
QUICK: dict[str, Any] = {
    "accelerator": "cpu",
    "enable_progress_bar": False,
    "enable_model_summary": False,
    "num_sanity_val_steps": 0,
}


def make(loaded: LightningData, **options: Any) -> CSMModule:
    data: DataModule = loaded.data
    settings = {"lr": 1e-2, "basis_k": 24, "training": {"name": "toy", "seed": 0}} | options
    torch.manual_seed(0)
    return CSMModule(
        NETWORK | settings.pop("network", {}),
        loaded.n_features,
        data.n_classes,
        record(data.recipe.descriptor),
        **settings,
    )


def make_placed(loaded: LightningData) -> CSMModule:
    """Return a module that describes by places and knows mirror images, with its first shape for the template."""
    others = also_classes(loaded.data, mirror=True)
    made = make(loaded, places=16, mirror=0.5, also_classes=others, standardise=True)
    first = loaded.data.fit_names[0]
    made.places.learn(loaded.sample(first), loaded.data.shape(first).mesh)
    return made


def train(module: CSMModule, loaded: LightningData, folder: Path, epochs: int = 12, **options: Any) -> Trainer:
    settings = QUICK | {"max_epochs": epochs, "default_root_dir": folder, "logger": False} | options
    trainer = Trainer(**settings)
    trainer.fit(module, datamodule=loaded)
    return trainer
