"""What train, evaluate and matrix share: test a trained module on sets of shapes and make result rows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

from omegaconf import DictConfig, OmegaConf
from torch import Tensor

from csm._processes import processes
from csm._progress import progress_bar
from csm._types import IntArray
from csm.data.datamodule import CorrespondenceDataModule
from csm.data.prepare import Job
from csm.data.shapeset import Shape, ShapeSet
from csm.errors import ConfigError
from csm.evaluation.matching import Votes, nearest
from csm.evaluation.protocol import Protocol, evaluate_matches
from csm.evaluation.provenance import provenance
from csm.evaluation.report import ResultRow, result_row
from csm.evaluation.results import Evaluation
from csm.learning.module import CSMModule

Matching: TypeAlias = Literal["nearest", "argmax"]
"""Nearest neighbour of the learned descriptor, or through the template by the classifier's votes."""


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps between any two shapes of a set, from their learned descriptors or, where given, the classifier's votes."""

    descriptors: Mapping[str, Tensor]
    votes: Mapping[str, Votes] | None = None

    def between(self, source: str, target: str, at: IntArray | None = None) -> IntArray:
        """Return for each source vertex (or those of `at`, -1 for the others) a vertex of the target."""
        if self.votes is not None:
            return self.votes[source].to(self.votes[target])
        return nearest(self.descriptors[source], self.descriptors[target], at=at)


@dataclass(frozen=True, eq=False)
class Tested:
    """One test set: its result row, the evaluation behind it, and for pictures the shapes and how they were matched."""

    row: ResultRow
    evaluation: Evaluation
    shapes: list[Shape]
    maps: Maps
    matching: Matching

    @property
    def label(self) -> str:
        """The test set, and how it was matched if not by the nearest neighbour."""
        return self.row.test if self.matching == "nearest" else f"{self.row.test}, {self.matching}"


def protocol_of(cfg: DictConfig) -> Protocol:
    """Make the protocol from the metric group."""
    options: dict[str, Any] = OmegaConf.to_container(cfg, resolve=True)  # type: ignore[assignment]
    try:
        return Protocol(**options)
    except TypeError as error:
        raise ConfigError(f"metric: {error}") from error


def test_on(
    module: CSMModule,
    datamodule: CorrespondenceDataModule,
    shapes: ShapeSet,
    protocol: Protocol,
    table: str,
    matchings: Sequence[Matching],
) -> list[Tested]:
    """Compute the learned descriptor of every test shape of a set, then match in each way and measure.

    Rows of a matching other than "nearest" say so in the name of their method.
    """
    for matching in matchings:
        if matching not in get_args(Matching):
            raise ConfigError(f"matching={matching!r}; wanted {' or '.join(get_args(Matching))}")
    names = datamodule.test_names(shapes)
    datamodule.fill([Job(shapes, name) for name in names])
    loaded = [datamodule.load(shapes, name) for name in names]
    descriptors = {
        item.sample.name: module.describe(item.sample)
        for item in progress_bar(loaded, desc=f"describe {shapes.name}", unit="shape", leave=False)
    }
    tested = []
    for matching in matchings:
        said = {name: module.votes(d) for name, d in descriptors.items()} if matching == "argmax" else None
        maps = Maps(descriptors, said)
        evaluation = _evaluate(maps, [item.shape for item in loaded], protocol, datamodule)
        row = _row(evaluation, module.hparams["training"], shapes.name, table, matching)
        tested.append(Tested(row, evaluation, [item.shape for item in loaded], maps, matching))
    return tested


def _evaluate(
    maps: Maps, shapes: Sequence[Shape], protocol: Protocol, datamodule: CorrespondenceDataModule
) -> Evaluation:
    def match(source: Shape, target: Shape) -> IntArray:
        return maps.between(source.name, target.name, at=source.truth.known)

    workers = processes(datamodule.workers, len(shapes))
    return evaluate_matches(shapes, match, protocol, workers=workers, memo=datamodule.store)


def _row(evaluation: Evaluation, training: Mapping[str, Any], test: str, table: str, matching: Matching) -> ResultRow:
    return result_row(
        [evaluation],
        provenance(),
        table=table,
        method=training["name"] + ("" if matching == "nearest" else f", {matching}"),
        train=training["set"],
        test=test,
        seeds=[training["seed"]],
        epochs=training["epochs"],
    )


def test_all(cfg: DictConfig, module: CSMModule, datamodule: CorrespondenceDataModule) -> list[Tested]:
    """Test on every test set of a data module, by the protocol of the configuration; one matching after the other."""
    protocol, matchings = protocol_of(cfg.metric), list(cfg.matching)
    tested = [
        test_on(module, datamodule, shapes, protocol, cfg.table, matchings) for shapes in datamodule.test_sets.values()
    ]
    return [by_set[i] for i in range(len(matchings)) for by_set in tested]


def numbers(tested: Sequence[Tested]) -> dict[str, float]:
    """Return the errors by test set, flat, for the job's record and for sweep tables."""
    return {
        f"{key}/{t.label}": float(value)
        for t in tested
        for key, value in (("age", t.row.age), ("exact", t.row.exact_match))
    }
