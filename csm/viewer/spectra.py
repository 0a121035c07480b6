"""Figures of eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from csm.errors import ConfigError
from csm.viewer.style import line_style, new_figure


def eigenvalues_figure(spectra: Mapping[str, ArrayLike]) -> Figure:
    """Plot eigenvalues over their index, one line per shape or operator, beside Weyl's law.

    Shapes that differ by an isometry have one line; the same shape at another resolution leaves it where the mesh is
    too coarse.

    Parameters
    ----------
    spectra
        Name -> eigenvalues (K,) in ascending order, of a surface of area 1; 1 / area.  K may differ.

    Raises
    ------
    ConfigError
        If there is no spectrum or one is not a vector.

    Notes
    -----
    Weyl, "Über die asymptotische Verteilung der Eigenwerte", 1911: for the isotropic Laplacian of a closed surface of
    area A, eigenvalue k approaches 4 pi k / A.
    """
    given = {name: np.asarray(values, dtype=np.float64) for name, values in spectra.items()}
    wrong = [name for name, values in given.items() if values.ndim != 1 or values.size == 0]
    if not given or wrong:
        raise ConfigError(f"eigenvalues figure: {wrong or 'nothing'} to draw; wanted a vector of eigenvalues per name")
    figure, axes = new_figure(5.2, 3.6)
    for k, (name, values) in enumerate(given.items()):
        axes.plot(np.arange(len(values)), values, label=name, **line_style(k))
    last = max(len(values) for values in given.values()) - 1
    axes.plot([0, last], [0, 4 * np.pi * last], color="0.55", linestyle=":", label="Weyl's law, isotropic")
    axes.set_xlabel("index of the eigenvalue, from 0")
    axes.set_ylabel("eigenvalue λ (1 / area)")
    axes.set_xlim(0, max(last, 1))
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure
