"""How every figure looks: colours and dashes of lines, bare axes, and figures that need no display."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Okabe and Ito, "Color universal design", 2008: told apart by people with any colour vision; yellow is left out.
CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
_DASHES = ("-", "--", "-.", ":")


def new_figure(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure of this size in inches, drawn without a display, with one pair of axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    plain_axes(axes)
    return figure, axes


def plain_axes(axes: Axes) -> None:
    """Take away the frame's upper and right side and put a faint grid below the data."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)


def line_style(k: int) -> dict[str, Any]:
    """Return the arguments of matplotlib that tell line k from the others: colours first, then dashes."""
    dash = _DASHES[k // len(CYCLE) % len(_DASHES)]
    return {"color": CYCLE[k % len(CYCLE)], "linestyle": dash, "linewidth": 1.8}
