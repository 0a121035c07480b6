"""Figure 4: the share of points within an error, for every descriptor and set of Table 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from csm.studies.bodies import RIVALS, label
from csm.studies.cells import Cell
from csm.studies.published import SETS
from csm.studies.study import Context, Findings
from csm.studies.table1 import measure_sets
from csm.viewer.figures import save_figure
from csm.viewer.style import line_style, plain_axes

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
    save_figure(path, curves_figure({SETS[key].title: column.cells for key, column in columns.items()}))
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


def curves_figure(panels: Mapping[str, Mapping[str, Cell]]) -> Figure:
    """Plot the curves of every set in a panel of its own, in the order of the mean errors of the first set.

    Parameters
    ----------
    panels
        Title of the set -> name of the descriptor -> its cell.
    """
    figure = Figure(figsize=(4.2 * len(panels) + 1.6, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    styles = {name: line_style(k) for k, name in enumerate(next(iter(panels.values())))}
    for axes, (title, cells) in zip(row, panels.items(), strict=True):
        plain_axes(axes)
        for name, cell in cells.items():
            axes.plot(cell.thresholds, 100 * cell.cqc, label=name, **styles[name])
        axes.set_xlim(0, next(iter(cells.values())).thresholds[-1])
        axes.set_ylim(0, 100)
        axes.set_title(title)
        axes.set_xlabel("geodesic error (fraction of the diameter)")
    row[0].set_ylabel("matches within the error (%)")
    lines = {str(line.get_label()): line for line in row[0].get_lines()}
    order = sorted(lines, key=lambda name: next(iter(panels.values()))[name].age)
    figure.legend(
        [lines[name] for name in order], [label(name) for name in order], loc="outside right center", frameon=False
    )
    return figure


def _shares(cell: Cell) -> dict[str, float]:
    return {f"% within {limit:g}": float(100 * np.interp(limit, cell.thresholds, cell.cqc)) for limit in WITHIN}
