"""The base class of the studies, their context, and the findings that they return."""

from __future__ import annotations

import csv
import io
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeAlias

from matplotlib.figure import Figure

from csm.data.shapes import ShapeSet
from csm.data.store import Store
from csm.descriptors.base import Descriptor
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.evaluation.provenance import Provenance
from csm.evaluation.report import ResultRow
from csm.evaluation.results import Evaluation
from csm.matching.methods import Method
from csm.mesh.io import atomic_path
from csm.operators.geodesic import Method as Distance
from csm.viewer.figures import save_figure

MEAN_ERROR = "mean error (thousandths of the diameter)"
"""The label of the axis that most figures share."""

Methods: TypeAlias = Sequence[Method | Descriptor | str]
Rows: TypeAlias = Sequence[dict[str, Any]]

NO_OPTION = {"option": False}
"""Metadata of a field with a default that only Python users and tests set: it is no option of the command."""


@dataclass(frozen=True, eq=False)
class FilledMatrix:
    """The averaged rows of a matrix, and by the name of each row what its training depends on, flat plain data."""

    rows: Sequence[ResultRow]
    settings: Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class Context:
    """Where a study finds its data and may keep what it has made.

    Parameters
    ----------
    root
        Folder of the data sets (a set is found anywhere below it, see `csm.data.registry.find_set`).
    out
        Folder of the artefacts; what is finished there is not computed again.
    store
        Of operators and descriptors.
    workers
        Processes to use.
    seed
        Of every draw.
    device
        Where networks run and features are compared.
    fill_matrix
        Called with the name of an experiment, the folder of its cells and overrides; trains and tests what is missing.
    """

    root: Path
    out: Path
    store: Store
    workers: int = 1
    seed: int = 0
    device: str = "cpu"
    fill_matrix: Callable[[str, Path, Sequence[str]], FilledMatrix] | None = None

    @property
    def results(self) -> Store:
        """The store of measured results."""
        return Store(self.out / "targets")

    def evaluate(
        self, methods: Methods, shapes: ShapeSet, protocol: EvaluationProtocol, **options: Any
    ) -> list[Evaluation]:
        """Call `csm.evaluation.engine.evaluate`; finished targets are kept in the folder of the artefacts."""
        options |= {"store": self.store, "results": self.results, "workers": self.workers, "device": self.device}
        return evaluate(methods, shapes, protocol, **options)


@dataclass(frozen=True)
class Study(ABC):
    """A table or figure; the fields of a subclass that have a default are its options.

    Parameters
    ----------
    name
        Such as "table1".
    """

    name: str

    @abstractmethod
    def run(self, context: Context) -> Findings:
        """Compute what is missing, and return the findings."""

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with their defaults, as plain data."""
        shown = [f for f in fields(cls) if f.default is not MISSING and f.metadata.get("option", True)]
        return {f.name: list(f.default) if isinstance(f.default, tuple) else f.default for f in shown}

    def findings(
        self, context: Context, title: str, columns: Iterable[str], rows: Rows, notes: Iterable[str], figure: Figure
    ) -> Findings:
        """Write the picture, NAME.png, and return the findings."""
        path = context.out / f"{self.name}.png"
        save_figure(path, figure)
        return Findings(self.name, title, tuple(columns), rows, tuple(notes), (path,))


@dataclass(frozen=True)
class OnPoints(Study):
    """A study that matches given pairs of shapes and measures the errors at drawn points.

    Parameters
    ----------
    points
        Template points that are measured per pair, drawn without replacement.
    distance
        Kind of geodesic distance of the errors.
    """

    points: int = 300
    distance: Distance = "exact"

    def evaluate(
        self, context: Context, methods: Methods, shapes: ShapeSet, pairs: Sequence[Pair], **options: Any
    ) -> list[Evaluation]:
        """Match the pairs by each method, and measure."""
        protocol = EvaluationProtocol(pairs, None, self.points, context.seed, self.distance, drawn="pair")
        return context.evaluate(methods, shapes, protocol, **options)


@dataclass(frozen=True, eq=False)
class Findings:
    """What a study found.

    Parameters
    ----------
    name
        Such as "table1".
    title
        One sentence: what is measured, on what.
    columns
        Keys of the rows that the table shows, in order.
    rows
        Plain data, all that the json holds; values that a table shows are texts, integers or floats.
    notes
        Sentences to read beside the numbers: protocol, assumptions, what differs from the paper and why.
    pictures
        Files that the study has written.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: Rows
    notes: tuple[str, ...] = ()
    pictures: tuple[Path, ...] = ()

    def markdown(self) -> str:
        """Return title, table and notes.

        Examples
        --------
        >>> print(Findings("t", "A title.", ("a", "b"), [{"a": 1, "b": 0.25}]).markdown())
        A title.
        <BLANKLINE>
        | a | b |
        |---|---|
        | 1 | 0.25 |
        """
        lines = ["| " + " | ".join(line) + " |" for line in [self.columns, *self._cells()]]
        lines.insert(1, "|" + "---|" * len(self.columns))
        return "\n".join([self.title, "", *lines, *(f"\n{note}" for note in self.notes)])

    def csv(self) -> str:
        """Return the shown columns as comma-separated values."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.columns, *self._cells()])
        return text.getvalue()

    def _cells(self) -> list[list[str]]:
        return [[_cell(row.get(column)) for column in self.columns] for row in self.rows]


def write_findings(findings: Findings, out: Path, made: Provenance, seconds: float) -> list[Path]:
    """Write NAME.json, NAME.csv and NAME.md into `out`, each under a temporary name first, and return their paths."""
    record = {
        "name": findings.name,
        "title": findings.title,
        "notes": list(findings.notes),
        "pictures": [path.name for path in findings.pictures],
        **asdict(made),
        "seconds": round(seconds, 1),
        "columns": list(findings.columns),
        "rows": list(findings.rows),
    }
    texts = {
        "json": json.dumps(record, indent=1, allow_nan=False, ensure_ascii=False) + "\n",
        "csv": findings.csv(),
        "md": findings.markdown() + "\n",
    }
    paths = []
    for suffix, text in texts.items():
        paths.append(out / f"{findings.name}.{suffix}")
        with atomic_path(paths[-1]) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return paths


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
