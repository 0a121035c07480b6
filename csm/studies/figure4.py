"""Figure 4: the share of points within an error, for every descriptor and set of Table 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from csm.studies.bodies import RIVALS, label
from csm.studies.cells import Cell
from csm.studies.published import SETS
from csm.studies.study import Context, Findings
from csm.studies.table1 import measure_sets
from csm.viewer.comparisons import curve_panels
from csm.viewer.figures import Curve, save_figure

WITHIN = (0.02, 0.05, 0.1, 0.2)
"""Errors, as fractions of the diameter, at which the table reads the curves."""


def run(
    context: Context,
    *,
    sets: Sequence[str] = tuple(SETS),
    descriptors: Sequence[str] = RIVALS,
    points: int | None = None,
    exact_points: int | None = 100,
    sample: int | None = None,
) -> Findings:
    """Draw the curves of the cells of `csm.studies.table1.run`, which see for parameters and errors."""
    columns = measure_sets(
        context, sets=sets, descriptors=descriptors, points=points, exact_points=exact_points, sample=sample
    )
    path = context.out / "figure4.png"
    panels = {SETS[key].title: _curves(column.cells) for key, column in columns.items()}
    save_figure(path, curve_panels(panels))
    rows = [
        {"set": SETS[key].title, "descriptor": name, "area under the curve": cell.summary["auc"], **_shares(cell)}
        | {"thresholds": cell.thresholds.tolist(), "cqc": cell.cqc.tolist()}
        for key, column in columns.items()
        for name, cell in column.cells.items()
    ]
    shown = ("set", "descriptor", "area under the curve", *(f"% within {limit:g}" for limit in WITHIN))
    notes = (
        "Errors are geodesic, as fractions of the diameter; the area is over errors up to 0.25, 1 if all were 0.",
        "The curves are those of the cells of Table 1, whose notes say how distances were measured.",
    )
    return Findings("figure4", "Share of points within an error, by descriptor and set.", shown, rows, notes, (path,))


def _curves(cells: Mapping[str, Cell]) -> dict[str, Curve]:
    return {label(name): Curve(cell.thresholds, cell.cqc, cell.age) for name, cell in cells.items()}


def _shares(cell: Cell) -> dict[str, float]:
    return {f"% within {limit:g}": float(100 * np.interp(limit, cell.thresholds, cell.cqc)) for limit in WITHIN}
