"""Figures that compare methods or settings by numbers: dots in rows, curves over errors and over parameters."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogFormatter

from csm._types import FloatArray
from csm.errors import ConfigError
from csm.viewer.figures import Curve
from csm.viewer.style import CYCLE, line_style, new_figure, plain_axes

_LEGEND_COLUMNS = 4
_LABEL_WIDTH = 24  # letters that the height of a panel has room for
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def dots_figure(names: Sequence[str], panels: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Plot one row of dots per name, with a panel per quantity and a kind of dot per condition.

    Parameters
    ----------
    names
        Of the R rows, from top to bottom.
    panels
        Label of the quantity -> condition -> its R values, not a number where there is none.  Panels have the same
        conditions; a legend names them if there are several.

    Raises
    ------
    ConfigError
        If there is nothing to draw or a condition has not one value per row.
    """
    wrong = [c for conditions in panels.values() for c, values in conditions.items() if len(values) != len(names)]
    if not names or not panels or wrong:
        raise ConfigError(f"dots figure: {wrong or 'nothing'} to draw; wanted {len(names)} values per condition")
    width = 0.4 + 0.075 * max(len(name) for name in names) + 2.9 * len(panels)
    figure = Figure(figsize=(width, 1.2 + 0.24 * len(names)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    heights = np.arange(len(names))
    for axes, (label, conditions) in zip(grid, panels.items(), strict=True):
        for k, (condition, values) in enumerate(conditions.items()):
            marker, color = _MARKERS[k % len(_MARKERS)], CYCLE[k % len(CYCLE)]
            axes.plot(values, heights, marker, markersize=5, color=color, label=condition, clip_on=False, zorder=3)
        plain_axes(axes)
        axes.set_xlim(left=0)
        axes.set_xlabel(label, fontsize=8)
        axes.tick_params(labelsize=8)
    grid[0].set_yticks(heights, list(names))
    grid[0].set_ylim(len(names) - 0.5, -0.5)
    handles, labels = grid[0].get_legend_handles_labels()
    if len(labels) > 1:
        columns = len(labels) if len(labels) <= _LEGEND_COLUMNS else _LEGEND_COLUMNS - 1
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
    return figure


def curve_panels(panels: Mapping[str, Mapping[str, Curve]]) -> Figure:
    """Plot shares of matches within an error, a panel per set; the legend goes by the mean errors of the first set.

    Parameters
    ----------
    panels
        Title of the set -> name of the method -> its curve, over errors as fractions of the diameter.

    Raises
    ------
    ConfigError
        If there is no curve.
    """
    names = list(dict.fromkeys(name for curves in panels.values() for name in curves))
    if not names:
        raise ConfigError(f"curves of {len(panels)} sets: there is nothing to draw")
    figure = Figure(figsize=(4.2 * len(panels) + 1.6, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    styles = {name: line_style(k) for k, name in enumerate(names)}
    lines: dict[str, Line2D] = {}
    ages: dict[str, float] = {}
    for axes, (title, curves) in zip(row, panels.items(), strict=True):
        plain_axes(axes)
        for name, curve in curves.items():
            (line,) = axes.plot(curve.thresholds, 100 * curve.cqc, label=name, **styles[name])
            lines.setdefault(name, line)
            ages.setdefault(name, curve.age)
        axes.set_xlim(0, max((float(curve.thresholds[-1]) for curve in curves.values()), default=1.0))
        axes.set_ylim(0, 100)
        axes.set_title(title)
        axes.set_xlabel("geodesic error (fraction of the diameter)")
    row[0].set_ylabel("matches within the error (%)")
    order = sorted(lines, key=ages.__getitem__)
    figure.legend([lines[name] for name in order], order, loc="outside right center", frameon=False)
    return figure


@dataclass(frozen=True, eq=False)
class Sweep:
    """Means over one parameter.

    Parameters
    ----------
    label
        Of the parameter.
    values
        Numbers or names, V of them in the order drawn; at equal distances, as a sweep chooses them.
    lines
        Name -> means and half the lengths of the bars around them, such as standard errors; both of shape (V,).  The
        sweeps of a figure have the same names.
    preset
        The value that the other sweeps hold this parameter at; marked if it is among the values.
    ring
        What the legend calls that mark.
    """

    label: str
    values: Sequence[float | str]
    lines: Mapping[str, tuple[FloatArray, FloatArray]]
    preset: float | str
    ring: str = "preset"


def sweeps_figure(sweeps: Sequence[Sweep], quantity: str) -> Figure:
    """Plot a quantity over several parameters, one panel each, on one vertical axis.

    Raises
    ------
    ConfigError
        If there is no sweep or one has no value.
    """
    if not sweeps or any(len(s.values) == 0 for s in sweeps):
        raise ConfigError(f"sweeps figure: {[s.label for s in sweeps]}; wanted at least one value for each")
    figure = Figure(figsize=(0.6 + 2.2 * len(sweeps), 2.7), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(1, len(sweeps), sharey=True, squeeze=False)[0]
    for axes, sweep in zip(grid, sweeps, strict=True):
        place = np.arange(len(sweep.values))
        chosen = [k for k, value in enumerate(sweep.values) if value == sweep.preset]
        for k, (name, (means, spread)) in enumerate(sweep.lines.items()):
            label = name if len(sweep.lines) > 1 else None
            axes.errorbar(place, means, spread, color=CYCLE[k], marker="o", ms=4, capsize=2.5, lw=1.4, label=label)
            ring = sweep.ring if k == len(sweep.lines) - 1 else None
            axes.plot(place[chosen], means[chosen], "o", ms=9, mfc="none", mec="0.2", mew=1.4, label=ring)
        axes.set_xticks(place, [value if isinstance(value, str) else f"{value:g}" for value in sweep.values])
        axes.set_xlabel(sweep.label, fontsize=9)
        axes.tick_params(labelsize=8)
        plain_axes(axes)
    grid[0].set_ylim(bottom=0)
    grid[0].set_ylabel(textwrap.fill(quantity, _LABEL_WIDTH), fontsize=9)
    grid[-1].legend(frameon=False, fontsize=8)
    return figure


def losses_figure(curves: Mapping[str, Sequence[float]]) -> Figure:
    """Plot losses over epochs, best first: the first curve is dark and named, the others are light.

    Raises
    ------
    ConfigError
        If there is no curve.
    """
    if not curves:
        raise ConfigError("losses figure: wanted at least one curve")
    figure = Figure(figsize=(5.4, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for k, (name, losses) in reversed(list(enumerate(curves.items()))):
        color, width, label = ("0.1", 1.8, name) if k == 0 else ("0.75", 0.9, None)
        dot = "o" if len(losses) == 1 else ""  # a line through one epoch is not to be seen
        axes.plot(np.arange(1, len(losses) + 1), losses, color=color, lw=width, label=label, marker=dot, ms=4)
    axes.set_yscale("log")
    axes.set_xlabel("epoch", fontsize=9)
    axes.set_ylabel("loss", fontsize=9)
    axes.legend(frameon=False, fontsize=8)
    plain_axes(axes)
    return figure


def training_figure(curves: Mapping[str, Sequence[tuple[int, float]]]) -> Figure:
    """Plot how a training went: losses on the left, and on the right the errors on validation shapes, if there are any.

    Parameters
    ----------
    curves
        Name, such as "train/loss" or "val/age" -> epochs, counted from 1, and the values after them.  Mean errors and
        rates are fractions.

    Raises
    ------
    ConfigError
        If there is no curve.
    """
    losses = {name: curve for name, curve in curves.items() if name.endswith("/loss")}
    panels = [part for part in (losses, {n: c for n, c in curves.items() if n not in losses}) if part]
    if not panels:
        raise ConfigError("training figure: wanted at least one curve")
    figure = Figure(figsize=(4.6 * len(panels), 3.3), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, part in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        for k, (name, curve) in enumerate(part.items()):
            epochs, values = zip(*curve, strict=True)
            axes.plot(epochs, values, marker="o", markersize=3, label=name, **line_style(k))
        axes.set_xlabel("epoch", fontsize=9)
        axes.set_ylabel("loss" if part is losses else "fraction (age: of the diameter)", fontsize=9)
        if part is losses:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(LogFormatter(labelOnlyBase=False))  # 8, not 8 times a power of ten
            axes.yaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(1, 0.4)))
        else:
            axes.set_ylim(bottom=0)
        axes.legend(frameon=False, fontsize=8)
        axes.xaxis.get_major_locator().set_params(integer=True)
        plain_axes(axes)
    return figure


def reliability_figure(curves: Mapping[str, Sequence[tuple[float, float, int]]]) -> Figure:
    """Plot how often matches are right over how confident csm was, with a line per kind of map.

    Parameters
    ----------
    curves
        Name -> steps of confidence: mean confidence and share of right matches, from 0 to 1, and the number of matches.
    """
    figure, axes = new_figure(4.6, 4.2)
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1, linestyle=(0, (2, 2)), label="perfect")
    most = max((count for steps in curves.values() for _, _, count in steps), default=1)
    for k, (name, steps) in enumerate(curves.items()):
        said, right, counts = (np.array(column) for column in zip(*steps, strict=True))
        axes.plot(said, right, label=name, **line_style(k))
        axes.scatter(said, right, s=8 + 80 * np.sqrt(counts / most), color=line_style(k)["color"], zorder=3)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.set_xlabel("confidence")
    axes.set_ylabel("share of right matches")
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    return figure
