"""Result files: the json rows behind every printed number, and the tables and curves made from them."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from typing import Any, TypeAlias

import numpy as np

from csm._locks import locked
from csm.errors import DataError
from csm.evaluation.provenance import Provenance
from csm.evaluation.results import Evaluation
from csm.mesh.io import atomic_path, read_bytes

Key: TypeAlias = tuple[str, ...]


@dataclass(frozen=True)
class ResultRow:
    """One number of a table with everything that it depends on.

    Parameters
    ----------
    table
        Which table the row belongs to.
    method, train, test
        Descriptor or network, set it was trained on ("none" for a handcrafted one), set it was tested on.
    age
        Mean geodesic error over points, pairs and seeds, as a fraction of the normaliser.
    age_std
        Standard deviation over seeds (n - 1); None for a single seed.
    exact_match
        Fraction of points matched to the very true vertex.
    seeds
        Of training, one per run that was averaged; empty if nothing is random.
    epochs
        Of training; None if nothing is trained.  The fewest of the seeds where a limit of time ended them.
    pairs
        Number of pairs of shapes.
    distance, normaliser
        As in `csm.evaluation.protocol.EvaluationProtocol`.
    command, commit, versions
        As in `csm.evaluation.provenance.Provenance`.
    seconds
        Wall time of the evaluation, all seeds together.
    p95, auc, flip_rate
        As in `csm.evaluation.metrics`, mean over seeds; None if not known.
    protocol
        The protocol in words.
    matching
        Name of the matcher.
    split, weights
        Whose test shapes were tested; hash of the network, of the first of several seeds.  Empty where it is not known.

    Raises
    ------
    DataError
        If a value cannot be true, such as an exact-match rate above 1.
    """

    table: str
    method: str
    train: str
    test: str
    age: float
    age_std: float | None
    exact_match: float
    seeds: tuple[int, ...]
    epochs: int | None
    pairs: int
    distance: str
    normaliser: str
    command: str
    commit: str
    versions: dict[str, str] = field(hash=False)
    seconds: float
    p95: float | None = None
    auc: float | None = None
    flip_rate: float | None = None
    protocol: str = ""
    matching: str = "nearest"
    split: str = ""
    weights: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "seeds", tuple(self.seeds))
        for name in ("table", "method", "train", "test", "distance", "normaliser", "command", "commit", "matching"):
            value = getattr(self, name)
            self._require(isinstance(value, str) and value != "", name, "a text that is not empty")
        for name in ("age", "age_std", "seconds", "p95"):
            self._require(_between(getattr(self, name), 0.0, math.inf), name, "a finite number from 0")
        for name in ("exact_match", "auc", "flip_rate"):
            self._require(_between(getattr(self, name), 0.0, 1.0), name, "a number from 0 to 1")
        self._require(self.pairs > 0, "pairs", "a count from 1")
        self._require(None not in (self.age, self.exact_match, self.seconds), "age", "age, exact_match and seconds")

    def _require(self, good: bool, name: str, wanted: str) -> None:
        if not good:
            raise DataError(
                f"result row {self.method}/{self.train}/{self.test}: {name} is {getattr(self, name)!r}, wanted {wanted}"
            )

    @property
    def key(self) -> Key:
        """What makes two rows the same cell of a table; a new row replaces the old one with this key."""
        return (self.table, self.method, self.train, self.test, self.distance, self.normaliser, self.matching)


def result_row(
    evaluations: Sequence[Evaluation],
    made: Provenance,
    *,
    table: str,
    method: str,
    train: str,
    test: str,
    seeds: Sequence[int],
    epochs: int | None,
) -> ResultRow:
    """Average evaluations of one protocol, one per seed, into a row.

    Raises
    ------
    DataError
        If there is none, or they follow different protocols.
    """
    if not evaluations or any(e.protocol != evaluations[0].protocol for e in evaluations):
        raise DataError(f"{method} on {test}: wanted one or more evaluations that follow one protocol")

    def mean(name: str) -> float:
        return float(np.mean([e.summary[name] for e in evaluations]))

    ages = [e.summary["age"] for e in evaluations]
    protocol, n_pairs = evaluations[0].protocol, len(evaluations[0].rows)
    flip_rate = mean("flip_rate")
    return ResultRow(
        table=table,
        method=method,
        train=train,
        test=test,
        age=mean("age"),
        age_std=float(np.std(ages, ddof=1)) if len(evaluations) > 1 else None,
        exact_match=mean("exact"),
        seeds=tuple(seeds),
        epochs=epochs,
        pairs=n_pairs,
        distance=protocol.distance,
        normaliser=protocol.normaliser,
        command=made.command,
        commit=made.commit,
        versions=made.versions,
        seconds=round(sum(e.seconds for e in evaluations), 1),
        p95=mean("p95"),
        auc=mean("auc"),
        flip_rate=None if math.isnan(flip_rate) else flip_rate,
        protocol=protocol.describe(n_pairs),
        matching=evaluations[0].matcher,
    )


def average_seeds(rows: Iterable[ResultRow]) -> list[ResultRow]:
    """Average rows that differ only in their seed; the command and versions are those of the first.

    Raises
    ------
    DataError
        If rows of one key follow different protocols, or repeat a seed.
    """
    groups: dict[Key, list[ResultRow]] = {}
    for row in rows:
        groups.setdefault(row.key, []).append(row)
    return [_average(group) if len(group) > 1 else group[0] for group in groups.values()]


def _average(rows: Sequence[ResultRow]) -> ResultRow:
    first = rows[0]
    seeds = tuple(seed for row in rows for seed in row.seeds)
    if len({row.protocol for row in rows}) > 1 or len(set(seeds)) < len(seeds) or len(seeds) < len(rows):
        raise DataError(
            f"{first.method} on {first.test}: rows of {len(rows)} seeds differ in protocol or repeat a seed, so they "
            "have no mean"
        )

    def mean(name: str) -> float | None:
        values = [getattr(row, name) for row in rows]
        return None if None in values else float(np.mean(values))

    averaged: dict[str, Any] = {name: mean(name) for name in ("age", "exact_match", "p95", "auc", "flip_rate")}
    return replace(
        first,
        **averaged,
        age_std=float(np.std([row.age for row in rows], ddof=1)),
        seeds=seeds,
        epochs=min((row.epochs for row in rows if row.epochs is not None), default=None),
        seconds=round(sum(row.seconds for row in rows), 1),
        commit=" ".join(dict.fromkeys(row.commit for row in rows)),
    )


def read_rows(path: str | os.PathLike[str]) -> list[ResultRow]:
    """Read a results file.

    Raises
    ------
    DataError
        If the file is not a json list of rows, or a row lacks a field or has an unknown one.
    """
    try:
        entries = json.loads(read_bytes(path))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: not a json file ({error}), so nothing is added; mend it or name another") from None
    if not isinstance(entries, list):
        raise DataError(f"{path}: holds a {type(entries).__name__}, wanted a list of result rows")
    return [_row(entry, f"{path}: row {i}") for i, entry in enumerate(entries)]


def write_rows(path: str | os.PathLike[str], rows: Sequence[ResultRow]) -> None:
    """Write a results file; readers see the old or the new one, never a part."""
    with atomic_path(path) as temporary:
        text = json.dumps([asdict(row) for row in rows], indent=1, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")


def merge_rows(old: Iterable[ResultRow], new: Iterable[ResultRow]) -> list[ResultRow]:
    """Return the old rows in their order and the new ones; a row replaces those of its key whose seeds it has, too."""
    groups: dict[Key, list[ResultRow]] = {}
    for row in [*old, *new]:
        others = [known for known in groups.get(row.key, []) if not set(known.seeds) <= set(row.seeds)]
        groups[row.key] = [*others, row]
    return [row for group in groups.values() for row in group]


def add_rows(path: str | os.PathLike[str], rows: Sequence[ResultRow]) -> list[ResultRow]:
    """Merge rows into a results file, which need not exist, and return what it holds now; processes take turns."""
    with locked(path):
        merged = merge_rows(read_rows(path) if os.path.lexists(path) else [], rows)
        write_rows(path, merged)
    return merged


def write_table_csv(path: str | os.PathLike[str], rows: Sequence[ResultRow]) -> None:
    """Write rows as csv, one column per field; seeds joined by blanks, versions left to the json."""
    names = [f.name for f in fields(ResultRow) if f.name != "versions"]
    _write_csv(path, names, [[_cell(getattr(row, name)) for name in names] for row in rows])


def write_curves_csv(path: str | os.PathLike[str], curves: Mapping[str, Evaluation]) -> None:
    """Write CQC curves as csv: a column of thresholds (fractions of the normaliser), then one column per curve.

    Raises
    ------
    DataError
        If there is no curve.
    """
    if not curves:
        raise DataError(f"{path}: there is no curve to write")
    columns = np.column_stack([next(iter(curves.values())).thresholds, *(e.cqc for e in curves.values())])
    _write_csv(path, ["threshold", *curves], [[f"{v:.6g}" for v in line] for line in columns])


def _row(entry: Any, where: str) -> ResultRow:
    if not isinstance(entry, dict):
        raise DataError(f"{where} is a {type(entry).__name__}, wanted an object")
    known = {f.name for f in fields(ResultRow)}
    needed = {f.name for f in fields(ResultRow) if f.default is MISSING}
    missing, unknown = sorted(needed - set(entry)), sorted(set(entry) - known)
    if missing or unknown:
        raise DataError(f"{where} lacks {missing or 'nothing'} and has unknown {unknown or 'nothing'}; is it older?")
    try:
        return ResultRow(**_with_matching(entry))
    except (TypeError, ValueError, DataError) as error:
        raise DataError(f"{where}: {error}") from None


def _with_matching(entry: dict[str, Any]) -> dict[str, Any]:
    """Split the name of a method such as "faust_mgcn, argmax", as rows of the first format have it."""
    method, _, matching = str(entry["method"]).rpartition(", ")
    old = "matching" not in entry and matching == "argmax"
    return {**entry, "method": method, "matching": matching} if old else entry


def _between(value: float | None, low: float, high: float) -> bool:
    return value is None or (math.isfinite(value) and low <= value <= high)


def _cell(value: Any) -> str:
    return "" if value is None else " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _write_csv(path: str | os.PathLike[str], header: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(lines)
