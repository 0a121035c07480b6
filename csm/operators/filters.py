"""Banks of spectral filters: functions of the eigenvalue that split a spectrum into overlapping bands.

In both banks the first column is the low-pass (scaling) function and the others are wavelets from coarse to fine.
"""

from __future__ import annotations

import numpy as np

from csm._types import FloatArray


def meyer_filters(evals: FloatArray, n: int, greatest: float) -> FloatArray:
    r"""Return a Meyer bank of `n` filters at the eigenvalues, shape (K, n).

    The scales are t_j = 4/3 2^{n-1-j} / lambda_max for j = 1 .. n - 1.  With x = t lambda and the polynomial
    nu(y) = y^4 (35 - 84 y + 70 y^2 - 20 y^3), which rises from 0 to 1 on [0, 1],

    .. math::
        h(x) = \cos\tfrac\pi2 \nu(\tfrac32 x - 1), \qquad
        g(x) = \sin\tfrac\pi2 \nu(\tfrac32 x - 1) \; \cos\tfrac\pi2 \nu(\tfrac34 x - 1)

    with the arguments of nu held within [0, 1]: h, used at t_1 only, ends at x = 4/3 and g lives on [2/3, 8/3).
    The squares of the n filters sum to 1 on [0, lambda_max].

    Parameters
    ----------
    evals
        Shape (K,).
    n
        Number of filters, at least 2.
    greatest
        lambda_max, the end of the band.

    References
    ----------
    Leonardi, Van De Ville, "Tight wavelet frames on multislice graphs", 2013; the scales are those of the code of
    Li et al., "Anisotropic spectral manifold wavelet descriptor", CGF 2021.
    """
    scales = 4 / (3 * greatest) * 2.0 ** np.arange(n - 2, -1, -1)
    x = evals[:, None] * scales
    low_pass = np.where(x[:, 0] < 4 / 3, np.cos(_meyer_phase(1.5 * x[:, 0] - 1)), 0.0)
    wavelets = np.where(x < 8 / 3, np.sin(_meyer_phase(1.5 * x - 1)) * np.cos(_meyer_phase(0.75 * x - 1)), 0.0)
    return np.column_stack([low_pass, wavelets])


def mexican_hat_filters(evals: FloatArray, n: int, greatest: float) -> FloatArray:
    r"""Return the low-pass and n - 1 Mexican-hat wavelets of WEDS at the eigenvalues, shape (K, n).

    With L = 1.01 lambda_max and l = L / 20,

    .. math::
        h(\lambda) = 1.004 \, e^{-(\lambda / 0.52 l)^3}, \qquad
        g_t(\lambda) = 0.443 \, (t \lambda)^2 e^{1 - (t \lambda)^2}

    for n - 1 scales t spaced logarithmically from 2.3 / l down to 0.2 / L.  Parameters as in `meyer_filters`.

    References
    ----------
    Hammond, Vandergheynst, Gribonval, "Wavelets on graphs via spectral graph theory", 2011, with the constants of the
    code of Wang et al., "MGCN: descriptor learning using multiscale GCNs", TOG 2020.
    """
    top = 1.01 * greatest
    low = top / 20
    low_pass = 1.004 * np.exp(-((evals / (0.52 * low)) ** 3))
    squares = (evals[:, None] * np.geomspace(2.3 / low, 0.2 / top, n - 1)) ** 2
    return np.column_stack([low_pass, 0.443 * squares * np.exp(1 - squares)])


def unit_sums(filters: FloatArray) -> FloatArray:
    """Divide each filter, a column of non-negative values, by its sum over the eigenvalues (zero filters stay)."""
    total = filters.sum(axis=0)
    return filters / np.where(total > 0, total, 1.0)


def filter_names(n: int) -> tuple[str, ...]:
    """Return what to call the filters of a bank of `n`.

    Examples
    --------
    >>> filter_names(3)
    ('low-pass', 'wavelet 1', 'wavelet 2')
    """
    return ("low-pass", *(f"wavelet {j}" for j in range(1, n)))


def _meyer_phase(y: FloatArray) -> FloatArray:
    y = np.clip(y, 0.0, 1.0)
    phase: FloatArray = 0.5 * np.pi * y**4 * (35 - 84 * y + 70 * y**2 - 20 * y**3)
    return phase
