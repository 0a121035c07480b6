"""One cell of a table of descriptors: a descriptor on a set, kept as json so that it is not made again."""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from csm._types import FloatArray
from csm.data.folderset import FolderSet
from csm.data.store import Store
from csm.descriptors.base import Descriptor, record
from csm.errors import DataError
from csm.evaluation.protocol import Pair
from csm.evaluation.provenance import Provenance, provenance
from csm.evaluation.results import summarise
from csm.mesh.io import atomic_path
from csm.studies.features import fill
from csm.studies.matching import Matched, Rules, match_pairs
from csm.studies.study import Context

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Cell:
    """What was measured of one descriptor on one set.

    Parameters
    ----------
    question
        Set, descriptor with its parameters, and protocol, as plain data: cells with equal ones are the same.
    summary
        As `csm.evaluation.results.Evaluation.summary`; a number that is not known is None.
    std
        Standard deviation of the mean errors of the pairs.
    uncertainty
        Standard error of the mean error that is due to points not measured exactly.
    pairs
        One row per pair, as `csm.evaluation.results.PairRow`.
    thresholds, cqc
        The curve.
    failures
        Shapes and targets that are left out, and why.
    made
        The code that it was made with.
    """

    question: Mapping[str, Any]
    summary: Mapping[str, float | None]
    std: float
    uncertainty: float
    pairs: Sequence[Mapping[str, Any]]
    thresholds: FloatArray
    cqc: FloatArray
    failures: Mapping[str, str]
    made: Provenance

    @property
    def age(self) -> float:
        """Mean error, a fraction of the normaliser."""
        age = self.summary["age"]
        assert age is not None
        return age


def fill_cells(
    context: Context,
    shapes: FolderSet,
    pairs: Sequence[Pair],
    descriptors: Mapping[str, Descriptor],
    rules: Rules,
) -> dict[str, Cell]:
    """Return the cells of descriptors on pairs of a set, from their files where these answer the same question.

    Files are below `context.out`, in ``cells`` and, target by target for resumption, in ``parts``.

    Raises
    ------
    DataError
        If no pair could be measured.
    """
    folder = context.out / "cells" / shapes.name
    questions = {name: _question(shapes, pairs, d, rules) for name, d in descriptors.items()}
    cells = {name: _kept(folder / f"{name}.json", question) for name, question in questions.items()}
    missing = {name: descriptors[name] for name, cell in cells.items() if cell is None}
    if missing:
        for name, cell in _make(context, shapes, pairs, missing, questions, rules).items():
            write_cell(folder / f"{name}.json", cell)
            cells[name] = cell
    return {name: cell for name, cell in cells.items() if cell is not None}


def _make(
    context: Context,
    shapes: FolderSet,
    pairs: Sequence[Pair],
    descriptors: Mapping[str, Descriptor],
    questions: Mapping[str, Mapping[str, Any]],
    rules: Rules,
) -> dict[str, Cell]:
    begun = time.perf_counter()
    names = list(dict.fromkeys(name for pair in pairs for name in pair))
    failures = fill(shapes, names, list(descriptors.values()), context.store, context.workers)
    left = [pair for pair in pairs if not set(pair) & set(failures)]
    stores = context.store, Store(context.out / "parts")
    found, failed = match_pairs(shapes, left, descriptors, rules, stores, context.workers)
    failures |= failed
    for name, why in failures.items():
        _log.warning("%s is left out: %s", name, why)
    if not any(found.values()):
        raise DataError(f"{shapes.name}: none of the {len(pairs)} pairs could be measured: {failures}")
    seconds = time.perf_counter() - begun
    return {name: _cell(questions[name], found[name], rules, failures, seconds) for name in descriptors}


def _question(shapes: FolderSet, pairs: Sequence[Pair], descriptor: Descriptor, rules: Rules) -> dict[str, Any]:
    question = {
        "set": shapes.name,
        "descriptor": record(descriptor),
        "protocol": rules.protocol.describe(len(pairs)),
        "exact_points": rules.exact_points,
        "pairs": [list(pair) for pair in pairs],
    }
    plain: dict[str, Any] = json.loads(json.dumps(question))
    return plain


def _cell(
    question: Mapping[str, Any], found: Sequence[Matched], rules: Rules, failures: Mapping[str, str], seconds: float
) -> Cell:
    measured = [pair for target in found for pair in target.pairs]
    evaluation = summarise(measured, rules.protocol, seconds)
    points = np.array([row.points for row in evaluation.rows])
    divisors = np.array([getattr(pair.lengths, rules.protocol.normaliser) for pair in measured])
    variances = np.array([v for target in found for v in target.variances]) / divisors**2
    return Cell(
        question,
        {name: None if math.isnan(value) else float(value) for name, value in evaluation.summary.items()},
        float(np.std([row.age for row in evaluation.rows])),
        float(np.sqrt((points**2 * variances).sum()) / points.sum()),
        [asdict(row) for row in evaluation.rows],
        evaluation.thresholds,
        evaluation.cqc,
        dict(failures),
        provenance(),
    )


def write_cell(path: Path, cell: Cell) -> None:
    """Write a cell as json, under a temporary name first."""
    record = asdict(cell) | {"thresholds": cell.thresholds.tolist(), "cqc": cell.cqc.tolist()}
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_cell(path: Path) -> Cell:
    """Read what `write_cell` wrote.

    Raises
    ------
    DataError
        If the file is something else.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        curves = {name: np.array(content[name], dtype=np.float64) for name in ("thresholds", "cqc")}
        return Cell(**content | curves | {"made": Provenance(**content["made"])})
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path}: not a cell of a table of descriptors ({error!r})") from None


def _kept(path: Path, question: Mapping[str, Any]) -> Cell | None:
    if not path.exists():
        return None
    try:
        cell = read_cell(path)
    except DataError as error:
        _log.warning("%s; it is made again", error)
        return None
    if cell.question != question:
        _log.warning("%s answers another question (descriptor, pairs or protocol); it is made again", path)
        return None
    if cell.failures:
        _log.info("%s lacks %s; they are tried again", path, ", ".join(cell.failures))
        return None
    return cell
