"""Tables and pictures of learned methods from the rows of a matrix, the paper's numbers beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from csm._types import FloatArray
from csm.errors import ConfigError
from csm.evaluation.report import ResultRow
from csm.evaluation.tables import error_cell
from csm.reproduction.published import LEARNED_AGE, row_title
from csm.reproduction.study import MEAN_ERROR, Context, FilledMatrix, Findings, Study
from csm.viewer.comparisons import Sweep, curve_panels, dots_figure, sweeps_figure
from csm.viewer.figures import Curve

_LABELS = {"model.ks": "eigenpairs $K_s$", "model.terms": "terms", "model.momentum": "BatchNorm momentum"}


@dataclass(frozen=True)
class Learned(Study):
    """A table or figure of trained networks.

    Parameters
    ----------
    experiment
        Of ``csm matrix``.
    cells
        Folder of the trained networks, below that of the artefacts; studies that name the same one share rows.
    picture
        Curves, with a panel per test set; all mean errors as dots; or the mean errors over the options in which rows
        differ from the first.
    overrides
        Of ``csm matrix``, such as ``seeds=[0]``.
    """

    experiment: str
    cells: str
    picture: Literal["dots", "curves", "sweeps"]
    overrides: tuple[str, ...] = ()

    def run(self, context: Context) -> Findings:
        """Fill the cells of the matrix that are missing, and put them beside the paper's."""
        if context.fill_matrix is None:
            raise ConfigError(f"{self.name}: trains networks, which needs Context.fill_matrix; csm reproduce has it")
        folder = context.out / self.cells
        matrix = context.fill_matrix(self.experiment, folder, self.overrides)
        nearest = [row for row in matrix.rows if row.matching == "nearest"]
        if self.picture == "sweeps":
            figure = sweeps(nearest, varied(matrix))
        else:
            figure = dots(nearest) if self.picture == "dots" else curves(folder, nearest)
        tests = ", ".join(dict.fromkeys(row.test for row in matrix.rows))
        first = matrix.rows[0]
        return self.findings(
            context,
            f"Mean geodesic error in thousandths of the {first.normaliser}; trained on {first.train}, tested on "
            f"{tests}.",
            *table(matrix.rows),
            notes(matrix.rows),
            figure,
        )


def table(rows: Sequence[ResultRow]) -> tuple[tuple[str, ...], list[dict[str, Any]]]:
    """Return the columns of a table of the rows of a matrix, and its lines, one per method.

    The rows are of one training set and kind of distance.  What was matched through the classifier stands beside what
    was matched by the nearest learned descriptor; the paper's errors have columns where it has any.
    """
    kinds = ("paper", "ours", *(["argmax"] if any(row.matching == "argmax" for row in rows) else []))
    tests = {row.test: _short(row) for row in rows}
    cells = [f"{short} {kind}" for short in tests.values() for kind in kinds]
    of_method: dict[str, list[ResultRow]] = {}
    for row in rows:
        of_method.setdefault(row.method, []).append(row)
    lines = [_line(method, mine, tests) for method, mine in of_method.items()]
    filled = [cell for cell in cells if not cell.endswith(" paper") or any(cell in line for line in lines)]
    return ("method", *filled, "exact %", "95th percentile", "epochs", "seeds"), lines


def _short(row: ResultRow) -> str:
    """Leave out of the test set's name what the training set's begins with too, such as FAUST_ or humans_."""
    family = row.train.rpartition("_")[0] or row.train
    return row.test.removeprefix(f"{family}_") or row.test


def _line(method: str, rows: Sequence[ResultRow], tests: Mapping[str, str]) -> dict[str, Any]:
    nearest = [row for row in rows if row.matching == "nearest"]
    line: dict[str, Any] = {"method": row_title(method), "row": method, "epochs": rows[0].epochs}
    line["seeds"] = " ".join(map(str, rows[0].seeds))
    paper = LEARNED_AGE.get(method, {})
    line |= {f"{short} paper": paper[test] for test, short in tests.items() if test in paper}
    for row in rows:
        line[f"{tests[row.test]} {'ours' if row.matching == 'nearest' else row.matching}"] = error_cell(row)
    line["exact %"] = " / ".join(f"{100 * row.exact_match:.0f}" for row in nearest)
    line["95th percentile"] = " / ".join("-" if row.p95 is None else f"{1000 * row.p95:.0f}" for row in nearest)
    line["rows"] = [asdict(row) for row in rows]
    return line


def notes(rows: Sequence[ResultRow]) -> list[str]:
    """Return a sentence on the matching, and every protocol with its test sets and, if not all, its methods."""
    methods, by_class = {row.method for row in rows}, any(row.matching == "argmax" for row in rows)
    found = [
        "Matched by the nearest learned descriptor"
        + (", and in columns of argmax through the classifier" * by_class)
        + "; ± is the standard deviation over seeds. Exact matches and the 95th percentile of the errors (thousandths) "
        "are of the nearest descriptor, in the order of the test sets."
    ]
    for protocol in dict.fromkeys(row.protocol for row in rows):
        these = [row for row in rows if row.protocol == protocol]
        own = dict.fromkeys(row.method for row in these)
        whose = "" if set(own) == methods else f" ({', '.join(own)})"
        found.append(f"{', '.join(dict.fromkeys(row.test for row in these))}{whose}: {protocol}")
    return found


def dots(rows: Sequence[ResultRow]) -> Figure:
    """Return a picture of the mean errors, a row per method and a kind of dot per test set."""
    ages = {(row.method, row.test): 1000 * row.age for row in rows}
    methods, tests = (dict.fromkeys(key[i] for key in ages) for i in (0, 1))
    values = {test: [ages.get((method, test), float("nan")) for method in methods] for test in tests}
    return dots_figure([row_title(method) for method in methods], {MEAN_ERROR: values})


def curves(folder: Path, rows: Sequence[ResultRow]) -> Figure:
    """Return a picture of the shares of points within an error, with a panel per test set."""
    panels: dict[str, dict[str, Curve]] = {}
    for row in rows:
        panels.setdefault(row.test, {})[row_title(row.method)] = _curve(folder, row)
    return curve_panels(panels)


def _curve(folder: Path, row: ResultRow) -> Curve:
    """Average the curves of a row's seeds, which the matrix keeps beside its cells."""
    file = f"{row.test}_{row.distance}_{row.normaliser}.cqc.csv"
    paths = [folder / row.method / f"seed{seed}" / file for seed in row.seeds]
    thresholds, fractions = np.mean([np.loadtxt(path, delimiter=",", skiprows=1) for path in paths], axis=0).T
    return Curve(thresholds, fractions, row.age)


def varied(matrix: FilledMatrix) -> dict[str, dict[float | str, str]]:
    """Return the options in which rows of a matrix differ from the first: label -> value -> row, the first row first.

    ConfigError if a row differs from the first in another number of options than one.
    """
    (preset, start), *others = matrix.settings.items()
    found: dict[str, dict[float | str, str]] = {}
    for row, settings in others:
        changed = [key for key in settings if settings[key] != start.get(key)]
        if len(changed) != 1:
            raise ConfigError(f"{row} differs from {preset} in {', '.join(changed) or 'nothing'}; wanted one option")
        label = _LABELS.get(changed[0], changed[0].rpartition(".")[2])
        found.setdefault(label, {start[changed[0]]: preset})[settings[changed[0]]] = row
    return found


def sweeps(rows: Sequence[ResultRow], varied: Mapping[str, Mapping[float | str, str]]) -> Figure:
    """Return a picture of the mean errors over options that were changed one at a time, with a line per test set.

    Of `varied` values whose row is not among `rows` are left out, as are options without any; numbers are drawn in
    ascending order.
    """
    found = {(row.method, row.test): row for row in rows}
    methods, tests = (dict.fromkeys(key[i] for key in found) for i in (0, 1))
    panels = []
    for label, names in varied.items():
        present = {value: name for value, name in names.items() if name in methods}
        values = sorted(present, key=lambda value: 0.0 if isinstance(value, str) else value)
        lines = {test: _line_over([found[present[value], test] for value in values]) for test in tests}
        panels += [Sweep(label, values, lines, next(iter(names)))] if values else []
    return sweeps_figure(panels, MEAN_ERROR)


def _line_over(rows: Sequence[ResultRow]) -> tuple[FloatArray, FloatArray]:
    spread = [0.0 if row.age_std is None else row.age_std for row in rows]
    return 1000 * np.array([row.age for row in rows]), 1000 * np.array(spread)
