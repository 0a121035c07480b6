"""Testing a method on the test sets of a data module, and the result rows of that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from csm.data.base import DataModule
from csm.data.shapes import ShapeSet, templates_of
from csm.data.store import Store
from csm.errors import ConfigError
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.provenance import provenance
from csm.evaluation.report import ResultRow, read_rows, result_row
from csm.evaluation.results import Evaluation
from csm.matching.base import Matcher
from csm.matching.methods import Method
from csm.matching.registry import matcher


@dataclass(frozen=True, eq=False)
class Tested:
    """One test set and matcher: the result row, the evaluation behind it, and what pictures are made of.

    Parameters
    ----------
    row, evaluation
        The numbers.
    shapes, names
        The test set, and which of its shapes were tested.
    method, matcher, store
        How they were matched, and where descriptors are kept.
    """

    row: ResultRow
    evaluation: Evaluation
    shapes: ShapeSet
    names: Sequence[str]
    method: Method
    matcher: Matcher
    store: Store

    @property
    def label(self) -> str:
        """The test set, and how it was matched if not by the nearest neighbour."""
        return self.row.test if self.row.matching == "nearest" else f"{self.row.test}, {self.row.matching}"


def measure_set(
    method: Method,
    data: DataModule,
    shapes: ShapeSet,
    protocol: EvaluationProtocol,
    *,
    matching: Sequence[str | Matcher] = ("nearest",),
    table: str = "test",
    results: Store | None = None,
    device: str = "cpu",
) -> list[Tested]:
    """Match the test shapes of one set in every way and measure, one result per matcher.

    Parameters
    ----------
    method
        A trained network or a descriptor.
    data
        Says which shapes of the set are test shapes, where the store is and how many processes to use.
    shapes
        One of the test sets of `data`, or another set over the same template with shapes of the same names.
    protocol, matching, results, device
        As of `csm.evaluation.engine.evaluate`.
    table
        Name of the table that the result rows belong to.
    """
    names = data.test_names(shapes)
    found = evaluate(
        method,
        shapes,
        protocol,
        matching=list(matching),
        names=names,
        store=data.store,
        results=results,
        workers=data.workers,
        device=device,
    )
    return [
        Tested(_row(e, method, shapes, table, data.split.label), e, shapes, names, method, matcher(rule), data.store)
        for e, rule in zip(found, matching, strict=True)
    ]


def measure_all(
    method: Method,
    data: DataModule,
    protocol: EvaluationProtocol,
    *,
    matching: Sequence[str | Matcher] = ("nearest",),
    table: str = "test",
    device: str = "cpu",
) -> list[Tested]:
    """Test on every test set of a data module, see `measure_set`; the results of one matcher come after the other's."""
    tested = [
        measure_set(method, data, shapes, protocol, matching=matching, table=table, device=device)
        for shapes in data.test_sets.values()
    ]
    return [by_matcher[i] for i in range(len(matching)) for by_matcher in tested]


def _row(evaluation: Evaluation, method: Method, shapes: ShapeSet, table: str, split: str) -> ResultRow:
    training: Mapping[str, Any] = getattr(method, "training", {})
    row = result_row(
        [evaluation],
        provenance(),
        table=table,
        method=method.name,
        train=" and ".join([training.get("set", "none"), *training.get("also", ())]),
        test=shapes.name,
        seeds=[training["seed"]] if "seed" in training else [],
        epochs=training.get("epochs"),
    )
    return replace(row, split=split, weights=weights_of(method, row.matching))


def weights_of(method: Method, matching: str) -> str:
    """Return the hash of the weights that a matcher goes by; empty for a handcrafted descriptor."""
    whole = str(method.key.get("weights", ""))
    return whole if matcher(matching.partition("+")[0]).by_classifier else str(getattr(method, "weights", whole))


def require_same_test(
    folder: Path, data: DataModule, protocol: EvaluationProtocol, matching: Sequence[str], method: Method | None = None
) -> None:
    """Raise before the work if a test in a folder would replace the rows of another one.

    Rows of the same test sets, protocol and matchers are replaced, which is what a repeated test is for; so are those
    to which the test adds others.

    Parameters
    ----------
    folder
        Where ``rows.json`` may be.
    data, protocol, matching
        What is to be tested, and how.
    method
        The network; None where a training that goes on changes it.

    Raises
    ------
    ConfigError
        If a row is there that the test does not measure again.
    DataError
        If what is there holds no rows.
    """
    path = folder / "rows.json"
    asked = {"matching": list(matching), "test set": list(data.test_sets), "split": [data.split.label], "protocol": []}
    for shapes in data.test_sets.values() if path.exists() else ():
        n_pairs = len(protocol.choose(data.test_names(shapes), templates_of(shapes)))
        asked["protocol"].append(protocol.describe(n_pairs))
    for row in read_rows(path) if path.exists() else ():
        had = {"matching": row.matching, "test set": row.test, "split": row.split, "protocol": row.protocol}
        other = [what for what in asked if had[what] and had[what] not in asked[what]]
        if not other and row.weights and method and row.weights != weights_of(method, row.matching):
            other = ["network"]
        if other:
            raise ConfigError(
                f"{path}: has the errors of {row.method} on {row.test} ({row.matching}) by a test with another "
                f"{other[0]}, which this one would replace; test into a new folder: csm evaluate checkpoint=MODEL "
                "hydra.run.dir=FOLDER"
            )


def numbers(tested: Sequence[Tested]) -> dict[str, float]:
    """Return the errors by test set, flat, for the job's record and for sweep tables."""
    return {
        f"{key}/{t.label}": float(value)
        for t in tested
        for key, value in (("age", t.row.age), ("exact", t.row.exact_match))
    }
