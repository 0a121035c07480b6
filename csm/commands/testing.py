"""What train, evaluate and matrix share: test a trained module on sets of shapes and make result rows of it."""

from __future__ import annotations

import logging
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf
from torch import Tensor
from tqdm import tqdm

from csm._types import IntArray
from csm.data.datamodule import CorrespondenceDataModule
from csm.data.shapeset import ShapeSet
from csm.errors import ConfigError
from csm.evaluation.matching import nearest
from csm.evaluation.protocol import EvalShape, Evaluation, Protocol, evaluate_matches
from csm.learning.module import CSMModule

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Tested:
    """The evaluation of one test set, with the descriptors and shapes for pictures."""

    shapes: ShapeSet
    evaluation: Evaluation
    items: list[EvalShape]
    descriptors: dict[str, Tensor]


def protocol_of(cfg: DictConfig) -> Protocol:
    """Make the protocol from the metric group."""
    options: dict[str, Any] = OmegaConf.to_container(cfg, resolve=True)  # type: ignore[assignment]
    try:
        return Protocol(**options)
    except TypeError as error:
        raise ConfigError(f"metric: {error}") from error


def test_on(module: CSMModule, datamodule: CorrespondenceDataModule, shapes: ShapeSet, protocol: Protocol) -> Tested:
    """Compute the learned descriptor of every test shape of a set, match by nearest neighbour and measure."""
    names = datamodule.test_names(shapes)
    items: list[EvalShape] = []
    descriptors: dict[str, Tensor] = {}
    for name in tqdm(names, desc=f"describe {shapes.name}", unit="shape"):
        shape = datamodule.prepared(shapes, name).shape
        items.append(EvalShape(name, shape.mesh, shape.truth, shape.mirror))
        descriptors[name] = module.describe(datamodule.sample(shapes, name))

    def match(source: EvalShape, target: EvalShape) -> IntArray:
        return nearest(descriptors[source.name], descriptors[target.name])

    return Tested(shapes, evaluate_matches(items, match, protocol), items, descriptors)
