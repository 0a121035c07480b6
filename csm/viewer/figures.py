"""Figures for papers, reports and TensorBoard: matplotlib `Figure` objects without a display or global state."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.evaluation.results import Evaluation
from csm.mesh.io import atomic_path
from csm.mesh.shape import Mesh
from csm.viewer.camera import View
from csm.viewer.colors import ERROR_COLORMAP, Colors, position_colors, pull_colors, scalar_colors
from csm.viewer.picture import Picture
from csm.viewer.render import render
from csm.viewer.style import CYCLE, line_style, new_figure, plain_axes

_DPI = 150
_NORMALISERS = {"diameter": "fraction of the geodesic diameter", "sqrt_area": "fraction of the square root of the area"}
# Dates would make two runs differ; an entry of None leaves matplotlib's own out.
_UNDATED: Mapping[str, dict[str, str | None]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}


class Curve(NamedTuple):
    """A CQC curve known only by its points, such as a published one."""

    thresholds: FloatArray
    """(T,) errors, as fractions of the normaliser."""
    cqc: FloatArray
    """(T,) fractions of matches with at most this error."""
    age: float
    """Mean error."""


Curves: TypeAlias = Mapping[str, Evaluation | Curve | tuple[FloatArray, FloatArray, float]]


def cqc_figure(curves: Curves, *, normaliser: str = "diameter", limit: float | None = None) -> Figure:
    """Plot the fraction of matches within an error, one curve per method, with the mean error (AGE) in the legend.

    Parameters
    ----------
    curves
        Name of the method -> its evaluation, or (thresholds (T,), cqc (T,), age).
    normaliser
        What the errors of bare curves are fractions of: "diameter" or "sqrt_area".
    limit
        Largest error shown; the largest threshold by default.

    Raises
    ------
    ConfigError
        If there is no curve, or curves are in different normalisers.
    """
    found = {c.protocol.normaliser if isinstance(c, Evaluation) else normaliser for c in curves.values()}
    if len(found) != 1:
        raise ConfigError(f"cqc figure: {len(curves)} curves in {len(found)} normalisers; wanted some curves in one")
    figure, axes = new_figure(5.2, 3.9)
    for k, (name, given) in enumerate(curves.items()):
        curve = Curve(given.thresholds, given.cqc, given.summary["age"]) if isinstance(given, Evaluation) else given
        thresholds, fractions, age = curve
        axes.plot(thresholds, 100 * fractions, label=f"{name} (AGE {1000 * age:.1f})", **line_style(k))
    last = max(float(line.get_xdata()[-1]) for line in axes.get_lines())  # type: ignore[index, arg-type]
    axes.set_xlim(0, last if limit is None else limit)
    axes.set_ylim(0, 100)
    axes.set_xlabel(_error_label(found.pop()))
    axes.set_ylabel("matches within the error (%)")
    axes.legend(loc="lower right", frameon=False, title="AGE in thousandths", alignment="left")
    return figure


def filters_figure(evals: ArrayLike, responses: Mapping[str, NDArray[np.floating]], strongest: int = 12) -> Figure:
    """Plot learned spectral filters over the eigenvalues, one column per layer.

    Above is how strong the gains of a layer are (without their signs): the median over its filters, and the bands that
    hold the middle half and nine tenths of them.  Below are the filters with the greatest root mean square.

    Parameters
    ----------
    evals
        Shape (K,), of the Laplacian, ascending; drawn as fractions of the last one.
    responses
        Name of the layer -> its filters, shape (K, ...): all that follows K are separate filters, such as input and
        output channels.
    strongest
        How many filters of a layer are drawn one by one, at most.

    Raises
    ------
    ConfigError
        If there is no layer, or a layer does not have K responses.
    """
    x = np.asarray(evals, dtype=np.float64)
    wrong = [name for name, r in responses.items() if r.ndim < 2 or r.shape[0] != len(x)]
    if not responses or wrong:
        raise ConfigError(f"filters figure: layers {wrong or 'none'}; wanted layers of shape ({len(x)}, ...)")
    figure = Figure(figsize=(3.8 * len(responses), 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, len(responses), sharex=True, squeeze=False)
    for (above, below), (name, given) in zip(panels.T, responses.items(), strict=True):
        filters = np.asarray(given, dtype=np.float64).reshape(len(x), -1)
        _gain_bands(above, x / x[-1], np.abs(filters))
        _strongest(below, x / x[-1], filters, given.shape[1:], strongest)
        above.set_title(f"{name}: {counted(filters.shape[1], 'filter')}", fontsize=10)
        below.set_xlabel(f"eigenvalue λ / λmax, λmax = {x[-1]:.3g}", fontsize=9)
        for axes in (above, below):
            plain_axes(axes)
            axes.tick_params(labelsize=8)
    panels[0, 0].set_ylabel("size of the gain", fontsize=9)
    panels[1, 0].set_ylabel("gain of the strongest", fontsize=9)
    return figure


def _gain_bands(axes: Axes, x: FloatArray, sizes: FloatArray) -> None:
    """Draw the median and two quantile bands of gains, shape (K, C), over x, shape (K,)."""
    low, lower, middle, upper, high = np.quantile(sizes, [0.05, 0.25, 0.5, 0.75, 0.95], axis=1)
    axes.fill_between(x, low, high, color=CYCLE[0], alpha=0.18, linewidth=0, label="nine tenths")
    axes.fill_between(x, lower, upper, color=CYCLE[0], alpha=0.35, linewidth=0, label="middle half")
    axes.plot(x, middle, color=CYCLE[0], linewidth=1.8, label="median")
    axes.set_ylim(0, 1.15 * max(float(high.max()), 1e-9))  # leaves room for the legend
    axes.legend(frameon=False, fontsize=7, ncols=3, loc="upper center")


def _strongest(axes: Axes, x: FloatArray, filters: FloatArray, shape: tuple[int, ...], count: int) -> None:
    """Draw the columns with the greatest root mean square of filters, shape (K, C); the legend has their channels."""
    order = np.argsort(-np.mean(filters**2, axis=0), kind="stable")[:count]
    colors = colormaps["turbo"](np.linspace(0.05, 0.95, len(order)))
    for k, column in enumerate(order):
        label = " → ".join(str(i) for i in np.unravel_index(column, shape))
        axes.plot(x, filters[:, column], color=colors[k], linestyle="-" if k % 2 else "--", linewidth=1.2, label=label)
    axes.axhline(0, color="0.3", linewidth=0.8)
    title = "channel" if len(shape) == 1 else "channel in → out"
    axes.legend(frameon=False, fontsize=7, title_fontsize=7, ncols=4, title=title, loc="upper center",
                bbox_to_anchor=(0.5, -0.2))  # fmt: skip


def correspondence_figure(
    source: Mesh,
    target: Mesh,
    indices: IntArray,
    errors: FloatArray | None = None,
    *,
    view: View | None = None,
    normaliser: str = "diameter",
    size: tuple[int, int] = (380, 560),
) -> Figure:
    """Draw a map by transferred colours, and its errors where they are known.

    The target is coloured by position; each vertex of the source has the colour of the vertex that it is mapped to,
    and grey if it has none.  The error of a vertex is drawn on the source.

    Parameters
    ----------
    source, target
        N_s and N_t vertices.
    indices
        Shape (N_s,), the vertex of the target for each vertex of the source, or -1.
    errors
        Shape (N_s,), as fractions of the normaliser, NaN where unknown (grey); the scale ends at their 99th percentile.
    view
        Where the viewer stands; from the front, with the longest axis up, by default.
    normaliser
        "diameter" or "sqrt_area", for the label.
    size
        Width and height in pixels of each of the two or three drawings.

    Raises
    ------
    ConfigError
        If the map or the errors do not fit the shapes.
    """
    _require_map(source, target, indices, errors)
    view = view or View(up="auto")
    reference = position_colors(target, up=view.up)
    drawn = [
        (f"source {source.name}, colours of its matches", source, pull_colors(reference, indices)),
        (f"target {target.name}, coloured by position", target, reference),
    ]
    if errors is None:
        return _drawings(drawn, view, size)
    high = _high(errors)
    drawn.append((f"error on {source.name}", source, scalar_colors(errors, 0.0, high, ERROR_COLORMAP)))
    figure = _drawings(drawn, view, size)
    scale = ScalarMappable(Normalize(0, high), ERROR_COLORMAP)
    bar = figure.colorbar(scale, ax=figure.axes[-1], shrink=0.7, extend="max")
    bar.set_label(_error_label(normaliser), fontsize=7)
    bar.ax.tick_params(labelsize=7)
    return figure


def figure_to_array(figure: Figure, dpi: float = _DPI) -> Picture:
    """Draw a figure into pixels, shape (H, W, 3)."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return np.array(Image.open(buffer).convert("RGB"))


def save_figure(path: str | os.PathLike[str], figure: Figure, dpi: float = 200) -> None:
    """Write a figure as .png, .pdf or .svg; the file is written completely or not at all.

    Raises
    ------
    ConfigError
        If the name ends otherwise.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _UNDATED:
        raise ConfigError(f"{path}: figures are written as {', '.join(_UNDATED)}; choose one of these endings")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi, metadata=_UNDATED[suffix])


def _require_map(source: Mesh, target: Mesh, indices: IntArray, errors: FloatArray | None) -> None:
    for what, given in (("map", indices), ("errors", errors)):
        if given is not None and given.shape != (source.n_vertices,):
            raise ConfigError(
                f"{source.name} -> {target.name}: the {what} has shape {given.shape}; "
                f"wanted one entry for each of the {source.n_vertices} vertices of the source"
            )


def _drawings(drawn: Sequence[tuple[str, Mesh, Colors]], view: View, size: tuple[int, int]) -> Figure:
    """Put titled drawings of coloured meshes side by side."""
    figure = Figure(figsize=(len(drawn) * size[0] / _DPI + 0.9, size[1] / _DPI + 0.4), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(drawn), squeeze=False)[0]
    for axes, (title, mesh, colors) in zip(panels, drawn, strict=True):
        axes.imshow(render(mesh, colors, size=size, view=view), interpolation="antialiased")
        axes.set_title(title, fontsize=7)
        axes.set_axis_off()
    return figure


def _error_label(normaliser: str) -> str:
    if normaliser not in _NORMALISERS:
        raise ConfigError(f"normaliser={normaliser!r} is unknown; choose one of {', '.join(_NORMALISERS)}")
    return f"geodesic error ({_NORMALISERS[normaliser]})"


def _high(errors: FloatArray) -> float:
    known = errors[np.isfinite(errors)]
    return float(np.percentile(known, 99)) or 1e-3 if known.size else 1e-3
