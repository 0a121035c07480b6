"""Table 1 and Figure 4: nearest-neighbour matching by every handcrafted descriptor, beside the paper's numbers."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from csm.data.folders import FolderSet
from csm.data.registry import find_set
from csm.errors import ConfigError, DataError
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.evaluation.results import Evaluation
from csm.reproduction.published import AGE, ASSUMED, RIVALS, SETS, family, label
from csm.reproduction.study import Context, Findings, Study
from csm.viewer.comparisons import curve_panels, dots_figure
from csm.viewer.figures import Curve

_log = logging.getLogger(__name__)

WITHIN = (0.02, 0.05, 0.1, 0.2)
"""Errors, as fractions of the diameter, at which Figure 4's table reads the curves."""


@dataclass(frozen=True, eq=False)
class Column:
    """One set: the evaluations by the names of the descriptors, and what to know of the pairs."""

    cells: Mapping[str, Evaluation]
    note: str


@dataclass(frozen=True)
class Table1(Study):
    """The mean error of every descriptor on every set, beside the paper's.

    Parameters
    ----------
    sets
        Out of `csm.reproduction.published.SETS`; one whose folder is not there is left out, which the notes say.
    descriptors
        Names of presets.
    points
        How many template points are measured, drawn; None for all.
    exact_points
        How many of these are measured exactly on each shape (see `csm.evaluation.distances`); None for all.
    sample
        How many of a set's pairs are drawn; None for all.
    """

    sets: tuple[str, ...] = tuple(SETS)
    descriptors: tuple[str, ...] = RIVALS
    points: int | None = None
    exact_points: int | None = 100
    sample: int | None = None

    def columns(self, context: Context) -> dict[str, Column]:
        """Return the columns of the sets that are below the context's root.

        ConfigError if a set or descriptor is unknown or a count is below 1, DataError if none of the sets is there.
        """
        unknown = [name for name in self.sets if name not in SETS]
        if unknown or not self.sets or not self.descriptors:
            raise ConfigError(
                f"{self.name}: sets {', '.join(unknown or self.sets)}, descriptors {', '.join(self.descriptors)}; "
                f"wanted some descriptors, and sets out of {', '.join(SETS)}"
            )
        found: dict[str, Column] = {}
        why = ""
        for key in self.sets:
            try:
                shapes = find_set(context.root, f"{key.upper()}_5k_remeshed")
            except DataError as error:
                why = str(error)
                _log.warning("%s is left out: %s", SETS[key], why)
            else:
                found[key] = self._column(context, key, shapes)
        if not found:
            raise DataError(f"none of the sets {', '.join(self.sets)} is there; {why}")
        return found

    def _column(self, context: Context, key: str, shapes: FolderSet) -> Column:
        pairs = usable_pairs(key, shapes)
        protocol = EvaluationProtocol(pairs, self.sample, self.points, context.seed, exact_points=self.exact_points)
        cells = {e.method: e for e in context.evaluate(self.descriptors, shapes, protocol, skip_failures=True)}
        if failed := [f"{name}: {e.failures}" for name, e in cells.items() if not e.rows]:
            raise DataError(f"{SETS[key]}: none of the pairs could be measured by {'; '.join(failed)}")
        drawn = "" if self.sample is None or self.sample >= len(pairs) else f", of which {self.sample} were drawn"
        points = "all" if self.points is None else f"{self.points} drawn"
        first = next(iter(cells.values()))
        lost = "".join(f" {name} is left out: {why}." for name, why in first.failures.items())
        return Column(
            cells,
            f"{SETS[key]}: {_which_pairs(key, shapes, len(pairs))}{drawn}; {len(first.rows)} pairs measured at "
            f"{points} template points known on both.{lost}",
        )

    def run(self, context: Context) -> Findings:
        """Measure what is missing and put the numbers beside the paper's."""
        columns = self.columns(context)
        rows = [_row(name, columns) for name in self.descriptors]
        shown = [f"{SETS[key]} {kind}" for key in columns for kind in ("paper", "ours", "ranks")]
        panels = {
            f"mean error on {SETS[key]}": {
                "paper": [row[f"{SETS[key]} paper"] or float("nan") for row in rows],
                "ours": [1000 * row[key]["age"] for row in rows],
            }
            for key in columns
        }
        return self.findings(
            context,
            "Mean geodesic error of nearest-neighbour matching, in thousandths of the diameter.",
            ("descriptor", *shown, "assumed"),
            rows,
            self._notes(columns),
            dots_figure([label(name) for name in self.descriptors], panels),
        )

    def _notes(self, columns: Mapping[str, Column]) -> list[str]:
        absent = [SETS[key] for key in self.sets if key not in columns]
        worst = max(cell.uncertainty for column in columns.values() for cell in column.cells.values())
        exact = (
            f"On each target, {self.exact_points} template points are measured by exact geodesics; the others by "
            "shortest paths along edges times the ratio of exact to edge distances over those points, one ratio per "
            f"descriptor and target. The standard error of a mean that is due to this is at most {1000 * worst:.2f} "
            "thousandths. The rates of left-right flips in the json are over the points measured exactly."
        )
        all_exact = self.exact_points is None or (self.points is not None and self.points <= self.exact_points)
        over = (
            f"{'all' if self.points is None else 'drawn'} points of {'all' if self.sample is None else 'drawn'} pairs"
        )
        notes = [
            f"Each cell has the mean error over {over} ± the standard deviation over pairs. Ranks are "
            "the paper's / ours, each among the families of this table, of which ACD stands in several settings. Equal "
            "ranks of the paper are ties.",
            "All distances are exact." if all_exact else exact,
            *(column.note for column in columns.values()),
            "Assumed: what of a descriptor no source says, so that its row is our best guess at what was run; the "
            "parameters are those of the docstrings.",
        ]
        return notes + ([f"Not below the folder of the data, so left out: {', '.join(absent)}."] if absent else [])


@dataclass(frozen=True)
class Figure4(Table1):
    """The share of points within an error, for every descriptor and set of Table 1."""

    def run(self, context: Context) -> Findings:
        """Draw the curves of Table 1's evaluations."""
        cells = {SETS[key]: column.cells for key, column in self.columns(context).items()}
        panels = {
            title: {label(name): Curve(e.thresholds, e.cqc, e.summary["age"]) for name, e in of_set.items()}
            for title, of_set in cells.items()
        }
        rows = [
            {"set": title, "descriptor": name, "area under the curve": e.summary["auc"]}
            | {f"% within {limit:g}": float(100 * np.interp(limit, e.thresholds, e.cqc)) for limit in WITHIN}
            | {"thresholds": e.thresholds.tolist(), "cqc": e.cqc.tolist()}
            for title, of_set in cells.items()
            for name, e in of_set.items()
        ]
        return self.findings(
            context,
            "Share of points within an error, by descriptor and set.",
            ("set", "descriptor", "area under the curve", *(f"% within {limit:g}" for limit in WITHIN)),
            rows,
            (
                "Errors are geodesic, as fractions of the diameter; the area is over errors up to 0.25, 1 if all were "
                "0.",
                "The curves are those of the cells of Table 1, whose notes say how distances were measured.",
            ),
            curve_panels(panels),
        )


def usable_pairs(key: str, shapes: FolderSet) -> list[Pair]:
    """Return the pairs of a set with ground truth, of FAUST only those of one person; DataError if there are none."""
    pairs = [(a, b) for a, b in shapes.mapped_pairs if key != "faust" or a[:-1] == b[:-1]]
    if not pairs:
        raise DataError(f"{shapes.root}: no pair of test_pairs.txt has ground truth here; `csm check` tells what lacks")
    return pairs


def _which_pairs(key: str, shapes: FolderSet, n: int) -> str:
    if key == "faust":
        return f"{n} pairs of two poses of one person among the {len(shapes.pairs)} of test_pairs.txt"
    if key == "tosca":
        classes = len({entry.template for entry in shapes.entries})
        return f"{n} pairs within the {classes} classes of {len(shapes.names)} shapes"
    there = f"{len(shapes.mapped)} of {len(shapes.names)} shapes have maps"
    return f"the {n} of {len(shapes.pairs)} pairs whose ground truth is there ({there})"


def ranks(values: Mapping[str, float]) -> dict[str, int]:
    """Return the place of each preset, from 1, among the families of the paper other than its own.

    Examples
    --------
    >>> ranks({"acd_paper": 0.2, "hks": 0.1, "wks": 0.3, "acd_release": 0.05})
    {'acd_paper': 2, 'hks': 2, 'wks': 3, 'acd_release': 1}
    """
    best: dict[str, float] = {}
    for name, value in values.items():
        if family(name) in AGE:
            best[family(name)] = min(value, best.get(family(name), value))
    return {
        name: 1 + sum(other < value for kind, other in best.items() if kind != family(name))
        for name, value in values.items()
    }


def _row(name: str, columns: Mapping[str, Column]) -> dict[str, Any]:
    kind = family(name)
    row: dict[str, Any] = {"descriptor": name, "family": kind, "assumed": ASSUMED.get(kind, "")}
    for key, column in columns.items():
        cell = column.cells[name]
        place = ranks({other: e.summary["age"] for other, e in column.cells.items()})[name]
        compared = {family(other) for other in column.cells} & set(AGE)
        paper = AGE.get(kind, {}).get(key)
        paper_place = None if paper is None else 1 + sum(AGE[other][key] < paper for other in compared - {kind})
        std = float(np.std([pair.age for pair in cell.rows]))
        row[f"{SETS[key]} paper"] = paper
        row[f"{SETS[key]} ours"] = f"{1000 * cell.summary['age']:.1f} ± {1000 * std:.1f}"
        row[f"{SETS[key]} ranks"] = f"{paper_place or '-'} / {place}"
        row[key] = {
            **{name: None if np.isnan(value) else value for name, value in cell.summary.items()},
            "std": std,
            "uncertainty": cell.uncertainty,
            "paper": None if paper is None else paper / 1000,
            "rank": place,
            "paper_rank": paper_place,
        }
    return row
