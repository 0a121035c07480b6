"""``csm evaluate checkpoint=...``: test a trained network on the test sets of any data module."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig

from csm.commands.app import command, output_folder
from csm.commands.report import conclude
from csm.commands.testing import numbers, test_all
from csm.data.datamodule import CorrespondenceDataModule
from csm.data.store import Store
from csm.errors import ConfigError
from csm.learning.export import load_module
from csm.learning.meshes import recipe_of
from csm.learning.module import CSMModule


def run(cfg: DictConfig) -> dict[str, Any]:
    """Test the checkpoint; descriptor and basis are those it was trained with."""
    if cfg.checkpoint is None:
        raise ConfigError("evaluate needs checkpoint=PATH, a .ckpt that csm train wrote")
    module = load_module(Path(cfg.checkpoint))
    datamodule = datamodule_of(cfg, module)
    tested = test_all(cfg, module, datamodule)
    conclude(tested, output_folder(), cfg.results, f"{cfg.checkpoint}: {module.hparams['training']['protocol']}.")
    return numbers(tested)


def datamodule_of(cfg: DictConfig, module: CSMModule) -> CorrespondenceDataModule:
    """Make the data module of the data group with the descriptor and basis of a trained module."""
    recipe = recipe_of(module)
    datamodule: CorrespondenceDataModule = instantiate(cfg.data, _partial_=True)(
        descriptor=recipe.descriptor,
        basis_k=recipe.basis_k,
        stencils=recipe.stencils,
        store=Store(cfg.store),
        workers=cfg.workers,
    )
    return datamodule


main = command("evaluate")(run)

if __name__ == "__main__":
    main()
