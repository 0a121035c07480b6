"""``csm train``: train a network on one set, then test it on every test set of its data module."""

from __future__ import annotations

import time
from typing import Any

import lightning as L
import torch
from hydra.utils import instantiate
from lightning.pytorch.callbacks import ModelCheckpoint, TQDMProgressBar
from omegaconf import DictConfig, OmegaConf

from csm.commands.app import command, output_folder
from csm.commands.testing import protocol_of, test_and_record
from csm.data.datamodule import CorrespondenceDataModule
from csm.data.store import Store
from csm.errors import ConfigError
from csm.learning.callbacks import ValidationErrors
from csm.learning.module import CSMModule


def run(cfg: DictConfig) -> dict[str, Any]:
    """Train and, unless ``test=false``, evaluate; return the numbers of the job."""
    if cfg.trainer.devices not in (1, "auto") or cfg.trainer.get("num_nodes", 1) != 1:
        raise ConfigError(f"trainer.devices={cfg.trainer.devices}: csm trains on one device, a batch is one shape")
    L.seed_everything(cfg.seed, workers=True, verbose=False)
    torch.set_float32_matmul_precision("highest")
    datamodule = make_datamodule(cfg)
    datamodule.prepare_data()
    module = make_module(cfg, datamodule)
    begun = time.perf_counter()
    trainer = make_trainer(cfg)
    trainer.fit(module, datamodule=datamodule, ckpt_path=cfg.resume, weights_only=True)
    seconds = time.perf_counter() - begun
    checkpoint = output_folder() / "model.ckpt"
    trainer.save_checkpoint(checkpoint)
    print(f"trained for {seconds / 60:.1f} minutes; checkpoint: {checkpoint}")
    validation = {k: float(v) for k, v in trainer.callback_metrics.items()}
    numbers: dict[str, Any] = {"seconds": seconds, "checkpoint": str(checkpoint), **validation}
    if cfg.test:
        numbers |= test_and_record(cfg, module, datamodule, list(datamodule.test_sets.values()), seconds)
    return numbers


def make_datamodule(cfg: DictConfig) -> CorrespondenceDataModule:
    """Make the data module of the data group, with its store and descriptor."""
    store, descriptor = Store(cfg.store), instantiate(cfg.descriptor)
    datamodule: CorrespondenceDataModule = instantiate(
        cfg.data, descriptor=descriptor, store=store, workers=cfg.workers
    )
    return datamodule


def make_module(cfg: DictConfig, datamodule: CorrespondenceDataModule) -> CSMModule:
    """Make the module of the model and optimizer groups for the shapes of a data module."""
    descriptor = datamodule.recipe.descriptor
    network: dict[str, Any] = OmegaConf.to_container(cfg.model, resolve=True)  # type: ignore[assignment]
    return CSMModule(
        network=network,
        in_channels=datamodule.n_features,
        n_classes=datamodule.n_classes,
        descriptor={"name": descriptor.name, **descriptor.parameters()},
        basis_k=datamodule.recipe.basis_k,
        **cfg.optimizer,
        training={
            "name": str(cfg.name),
            "set": datamodule.train_set.name,
            "split": datamodule.split.label,
            "protocol": datamodule.protocol,
            "seed": int(cfg.seed),
            "epochs": int(cfg.trainer.max_epochs),
        },
    )


def make_trainer(cfg: DictConfig) -> L.Trainer:
    """Make the trainer with its callbacks; checkpoints are kept so that a killed run can go on."""
    folder = output_folder()
    callbacks = [
        ValidationErrors(seed=cfg.seed),
        ModelCheckpoint(folder / "checkpoints", filename="{epoch:03d}", save_last=True, every_n_epochs=1),
        TQDMProgressBar(leave=False),
    ]
    logger = instantiate(cfg.logger, save_dir=folder) if cfg.logger else False
    trainer: L.Trainer = instantiate(cfg.trainer, callbacks=callbacks, logger=logger, default_root_dir=folder)
    return trainer


main = command("train")(run)

if __name__ == "__main__":
    main()
