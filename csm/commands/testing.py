"""What train, evaluate and matrix share: test a trained module on sets of shapes and make result rows of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from omegaconf import DictConfig, OmegaConf
from torch import Tensor

from csm._progress import progress_bar
from csm._types import IntArray
from csm.data.datamodule import CorrespondenceDataModule
from csm.data.prepare import Job, processes
from csm.data.shapeset import Shape, ShapeSet
from csm.errors import ConfigError
from csm.evaluation.matching import nearest
from csm.evaluation.protocol import Protocol, evaluate_matches
from csm.evaluation.provenance import provenance
from csm.evaluation.report import ResultRow, result_row
from csm.evaluation.results import Evaluation
from csm.learning.module import CSMModule


@dataclass(frozen=True, eq=False)
class Tested:
    """One test set: its result row, the evaluation behind it, and the shapes and descriptors for pictures."""

    row: ResultRow
    evaluation: Evaluation
    shapes: list[Shape]
    descriptors: dict[str, Tensor]


def protocol_of(cfg: DictConfig) -> Protocol:
    """Make the protocol from the metric group."""
    options: dict[str, Any] = OmegaConf.to_container(cfg, resolve=True)  # type: ignore[assignment]
    try:
        return Protocol(**options)
    except TypeError as error:
        raise ConfigError(f"metric: {error}") from error


def test_on(
    module: CSMModule, datamodule: CorrespondenceDataModule, shapes: ShapeSet, protocol: Protocol, table: str
) -> Tested:
    """Compute the learned descriptor of every test shape of a set, match by nearest neighbour, and measure."""
    names = datamodule.test_names(shapes)
    datamodule.fill([Job(shapes, name) for name in names])
    loaded = [datamodule.load(shapes, name) for name in names]
    descriptors = {
        item.sample.name: module.describe(item.sample)
        for item in progress_bar(loaded, desc=f"describe {shapes.name}", unit="shape", leave=False)
    }

    def match(source: Shape, target: Shape) -> IntArray:
        return nearest(descriptors[source.name], descriptors[target.name], at=source.truth.known)

    workers = processes(datamodule.workers, len(names))
    evaluation = evaluate_matches([item.shape for item in loaded], match, protocol, workers=workers)
    training = module.hparams["training"]
    row = result_row(
        [evaluation],
        provenance(),
        table=table,
        method=training["name"],
        train=training["set"],
        test=shapes.name,
        seeds=[training["seed"]],
        epochs=training["epochs"],
    )
    return Tested(row, evaluation, [item.shape for item in loaded], descriptors)


def test_all(cfg: DictConfig, module: CSMModule, datamodule: CorrespondenceDataModule) -> list[Tested]:
    """Test on every test set of a data module, by the protocol of the configuration."""
    protocol = protocol_of(cfg.metric)
    return [test_on(module, datamodule, shapes, protocol, cfg.table) for shapes in datamodule.test_sets.values()]


def numbers(tested: Sequence[Tested]) -> dict[str, float]:
    """Return the errors by test set, flat, for the job's record and for sweep tables."""
    return {
        f"{key}/{t.row.test}": float(value)
        for t in tested
        for key, value in (("age", t.row.age), ("exact", t.row.exact_match))
    }
