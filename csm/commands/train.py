"""``csm train``: train a network on one set, then test it on every test set of its data module."""

from __future__ import annotations

import logging
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import lightning as L
from hydra.utils import instantiate
from lightning.pytorch.callbacks import ModelCheckpoint
from omegaconf import DictConfig, OmegaConf

from csm.commands.app import command, make_datamodule, output_folder
from csm.commands.report import conclude
from csm.commands.testing import numbers, test_all
from csm.data.datamodule import CorrespondenceDataModule
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.learning.callbacks import EpochLines, ValidationErrors
from csm.learning.export import export_module
from csm.learning.module import CSMModule
from csm.learning.panels import TensorBoardPanels


def run(cfg: DictConfig) -> dict[str, Any]:
    """Train and, unless ``test=false``, test; return the numbers of the job."""
    folder = output_folder()
    datamodule = make_datamodule(cfg)
    module, found = fit(cfg, datamodule, folder)
    if not cfg.test:
        return found
    tested = test_all(cfg, module, datamodule)
    conclude(tested, folder, cfg.results, f"{cfg.name}: {module.hparams['training']['protocol']}.")
    if cfg.logger:
        print(f"TensorBoard:  tensorboard --logdir {folder}")
    return found | numbers(tested)


def fit(cfg: DictConfig, datamodule: CorrespondenceDataModule, folder: Path) -> tuple[CSMModule, dict[str, Any]]:
    """Train and save ``model.ckpt`` in `folder`; return the module and what was measured on the way."""
    if cfg.trainer.devices not in (1, "auto") or cfg.trainer.get("num_nodes", 1) != 1:
        raise ConfigError(f"trainer.devices={cfg.trainer.devices}: csm trains on one device, as a batch is one shape")
    _quiet_lightning()
    L.seed_everything(cfg.seed, workers=True, verbose=False)
    datamodule.prepare_data()
    module = make_module(cfg, datamodule)
    trainer = make_trainer(cfg, folder)
    begun = time.perf_counter()
    trainer.fit(module, datamodule=datamodule, ckpt_path=cfg.resume, weights_only=True)
    seconds = time.perf_counter() - begun
    module.hparams["training"]["epochs"] = trainer.current_epoch  # fewer than asked for where max_time ended it
    checkpoint = folder / "model.ckpt"
    trainer.save_checkpoint(checkpoint)
    export_module(module, folder / "export")
    print(f"trained for {seconds / 60:.1f} minutes: {checkpoint}")
    measured = {key: float(value) for key, value in trainer.callback_metrics.items()}
    return module, {"seconds": seconds, "checkpoint": str(checkpoint), **measured}


def _quiet_lightning() -> None:
    """Keep Lightning's hints and advertisements out of the output; its warnings stay."""
    logging.getLogger("lightning.pytorch").setLevel(logging.WARNING)
    logging.getLogger("lightning.fabric").setLevel(logging.WARNING)
    warnings.filterwarnings("ignore", message=r".*LeafSpec.*is deprecated")
    warnings.filterwarnings("ignore", message=r".*does not have many workers.*")


def make_module(cfg: DictConfig, datamodule: CorrespondenceDataModule) -> CSMModule:
    """Make the module of the model and optimizer groups for the shapes of a data module."""
    descriptor, made = datamodule.recipe.descriptor, provenance()
    network: dict[str, Any] = OmegaConf.to_container(cfg.model, resolve=True)  # type: ignore[assignment]
    return CSMModule(
        network=network,
        in_channels=datamodule.n_features,
        n_classes=datamodule.n_classes,
        descriptor=record(descriptor),
        basis_k=datamodule.recipe.basis_k,
        **cfg.optimizer,
        training={
            "name": str(cfg.name),
            "set": datamodule.train_set.name,
            "protocol": datamodule.protocol,
            "seed": int(cfg.seed),
            "epochs": int(cfg.trainer.max_epochs),
            "command": made.command,
            "commit": made.commit,
        },
    )


def make_trainer(cfg: DictConfig, folder: Path) -> L.Trainer:
    """Make the trainer with its callbacks; the last checkpoint is kept so that a killed run can go on.

    Lightning's bar redraws itself on stdout at every step; where that is no terminal, lines take its place.
    """
    errors = ValidationErrors(seed=cfg.seed)
    groups = ("seed", "data", "descriptor", "model", "optimizer", "trainer")
    hparams = {name: OmegaConf.to_container(cfg, resolve=True)[name] for name in groups}  # type: ignore[index, call-overload]
    progress = cfg.trainer.get("enable_progress_bar", True)
    terminal = sys.stdout.isatty()
    callbacks = [
        errors,
        TensorBoardPanels(errors, hparams),
        ModelCheckpoint(
            folder / "checkpoints", filename="last", enable_version_counter=False, save_on_train_epoch_end=True
        ),
        *([EpochLines()] if progress and not terminal else []),
    ]
    logger = instantiate(cfg.logger, _partial_=True)(save_dir=folder) if cfg.logger else False
    trainer: L.Trainer = instantiate(cfg.trainer, _partial_=True)(
        callbacks=callbacks, logger=logger, default_root_dir=folder, enable_progress_bar=progress and terminal
    )
    return trainer


main = command("train")(run)

if __name__ == "__main__":
    main()
