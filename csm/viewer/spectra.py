"""Figures of eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from csm._types import FloatArray
from csm.errors import ConfigError
from csm.viewer.style import line_style, plain_axes


def resolutions_figure(spectra: Mapping[str, Mapping[str, ArrayLike]], reference: str) -> Figure:
    """Plot eigenvalues of one shape at several resolutions, and below how far they are from those of one of them.

    Parameters
    ----------
    spectra
        Operator -> resolution -> eigenvalues (K,) in ascending order, of a surface of area 1; 1 / area.  One pair of
        panels per operator.
    reference
        The resolution that deviations are taken from, such as the finest.

    Raises
    ------
    ConfigError
        If there is no operator, or one lacks the reference or has spectra of different lengths.
    """
    given = {op: {r: np.asarray(v, dtype=np.float64) for r, v in lines.items()} for op, lines in spectra.items()}
    wrong = [op for op, v in given.items() if reference not in v or len({x.shape for x in v.values()}) != 1]
    if not given or wrong:
        raise ConfigError(
            f"resolutions figure: {wrong or 'nothing'} to draw; wanted spectra of one length and {reference!r}"
        )
    figure = Figure(figsize=(0.7 + 2.05 * len(given), 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, len(given), sharex=True, sharey="row", squeeze=False, height_ratios=(3, 2))
    for column, (operator, lines) in zip(panels.T, given.items(), strict=True):
        above, below = column
        for k, (resolution, values) in enumerate(lines.items()):
            index = np.arange(len(values))
            above.plot(index, values, label=resolution, **line_style(k) | {"linewidth": 1.3})
            if resolution != reference:
                below.plot(index[1:], deviation(values, lines[reference]), **line_style(k) | {"linewidth": 1.3})
        above.set_title(operator, fontsize=9)
        below.axhline(0, color="0.3", linewidth=0.8)
        below.set_xlabel("index of the eigenvalue", fontsize=8)
        for axes in column:
            plain_axes(axes)
            axes.tick_params(labelsize=7.5)
    panels[0, 0].set_ylabel("eigenvalue λ (1 / area)", fontsize=8)
    panels[0, 0].set_ylim(bottom=0)
    panels[1, 0].set_ylabel(f"deviation (%) from\n{reference}", fontsize=8)
    handles, names = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=8)
    return figure


def deviation(values: FloatArray, reference: FloatArray) -> FloatArray:
    """Return by how many per cent eigenvalues (K,) exceed those of a reference, without the first, which is zero."""
    percent: FloatArray = 100 * (values[1:] / reference[1:] - 1)
    return percent
