"""Tables and pictures of learned methods from the rows of a matrix, the paper's numbers beside ours."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from csm._types import FloatArray
from csm.evaluation.report import ResultRow
from csm.evaluation.tables import error_cell
from csm.studies.contenders import row_title
from csm.studies.published import LEARNED_AGE
from csm.studies.study import MEAN_ERROR, Findings
from csm.viewer.comparisons import Sweep, curve_panels, dots_figure, sweeps_figure
from csm.viewer.figures import Curve

_BY_CLASS = ", argmax"
"""What the name of a row ends in that was matched through the classifier."""


def findings(name: str, rows: Sequence[ResultRow], pictures: Sequence[Path] = ()) -> Findings:
    """Return the rows of a filled matrix as findings, a line per method.

    Parameters
    ----------
    name
        Of the study.
    rows
        Of one training set and kind of distance; what was matched through the classifier stands beside what was matched
        by the nearest learned descriptor.
    pictures
        Files that belong to it.
    """
    tests = list(dict.fromkeys(row.test for row in rows))
    short = {test: _short(test, rows[0].train) for test in tests}
    by_class = any(row.method.endswith(_BY_CLASS) for row in rows)
    lines = [
        _line(method, [row for row in rows if row.method.removesuffix(_BY_CLASS) == method], short)
        for method in dict.fromkeys(row.method.removesuffix(_BY_CLASS) for row in rows)
    ]
    cells = [
        f"{short[test]}{kind}" for test in tests for kind in (" paper", " ours", *([" argmax"] if by_class else []))
    ]
    title = (
        f"Mean geodesic error in thousandths of the {rows[0].normaliser}; trained on {rows[0].train}, tested on "
        f"{', '.join(tests)}."
    )
    notes = [
        "Matched by the nearest learned descriptor"
        + (", and in columns of argmax through the classifier" * by_class)
        + "; ± is the standard deviation over seeds. Exact matches and the 95th percentile of the errors (thousandths) "
        "are of the nearest descriptor, in the order of the test sets.",
        *_protocols(rows),
    ]
    columns = ("method", *cells, "exact %", "95th percentile", "epochs", "seeds")
    return Findings(name, title, columns, lines, tuple(notes), tuple(pictures))


def _line(method: str, rows: Sequence[ResultRow], short: dict[str, str]) -> dict[str, Any]:
    line: dict[str, Any] = {"method": row_title(method), "row": method, "epochs": rows[0].epochs}
    line["seeds"] = " ".join(map(str, rows[0].seeds))
    for test, paper in LEARNED_AGE.get(method, {}).items():
        if test in short:
            line[f"{short[test]} paper"] = paper
    nearest = [row for row in rows if row.method == method]
    for row in rows:
        kind = "ours" if row.method == method else "argmax"
        line[f"{short[row.test]} {kind}"] = error_cell(row)
    line["exact %"] = " / ".join(f"{100 * row.exact_match:.0f}" for row in nearest)
    line["95th percentile"] = " / ".join("-" if row.p95 is None else f"{1000 * row.p95:.0f}" for row in nearest)
    line["rows"] = [asdict(row) for row in rows]
    return line


def _short(test: str, train: str) -> str:
    """Leave out what the names of both sets begin with, such as FAUST_."""
    family = train.rpartition("_")[0] + "_"
    return test.removeprefix(family) or test


def _protocols(rows: Sequence[ResultRow]) -> list[str]:
    """Return every protocol with the test sets, and the methods if not all, that it is of."""
    methods = {row.method for row in rows}
    found = []
    for protocol in dict.fromkeys(row.protocol for row in rows):
        these = [row for row in rows if row.protocol == protocol]
        own = dict.fromkeys(row.method for row in these)
        whose = "" if set(own) == methods else f" ({', '.join(own)})"
        found.append(f"{', '.join(dict.fromkeys(row.test for row in these))}{whose}: {protocol}")
    return found


def dots(rows: Sequence[ResultRow]) -> Figure:
    """Return a picture of the mean errors, with a kind of dot per test set."""
    ages = {(row.method, row.test): 1000 * row.age for row in rows}
    methods, tests = (list(dict.fromkeys(key[i] for key in ages)) for i in (0, 1))
    values = {test: [ages.get((method, test), float("nan")) for method in methods] for test in tests}
    names = [row_title(method) for method in methods]
    return dots_figure(names, {MEAN_ERROR: values})


def curves(folder: Path, rows: Sequence[ResultRow]) -> Figure:
    """Return a picture of the shares of points within an error, with a panel per test set."""
    panels: dict[str, dict[str, Curve]] = {row.test: {} for row in rows}
    for row in rows:
        panels[row.test][row_title(row.method)] = _curve(folder, row)
    return curve_panels(panels)


def _curve(folder: Path, row: ResultRow) -> Curve:
    """Average the curves of a row's seeds, which the matrix keeps beside its cells."""
    file = f"{row.test}_{row.distance}_{row.normaliser}.cqc.csv"
    tables = []
    for seed in row.seeds:
        with (folder / row.method / f"seed{seed}" / file).open(newline="", encoding="utf-8") as opened:
            tables.append(np.array([[float(cell) for cell in line] for line in list(csv.reader(opened))[1:]]))
    thresholds, fractions = np.mean(tables, axis=0).T
    return Curve(thresholds, fractions, row.age)


def sweeps(rows: Sequence[ResultRow], varied: Mapping[str, Mapping[float | str, str]]) -> Figure:
    """Return a picture of the mean errors over options that were changed one at a time, with a line per test set.

    Parameters
    ----------
    rows
        Of the matrix.
    varied
        Label of the option -> its values -> their rows, that of the preset first.  Values whose row is not among `rows`
        are left out, as are options without any; numbers are drawn in ascending order.
    """
    found = {(row.method, row.test): row for row in rows}
    methods, tests = ({key[i]: None for key in found} for i in (0, 1))
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
