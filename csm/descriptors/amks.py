"""The average mixing kernel signature (AMKS)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from csm._types import FloatArray
from csm.descriptors.base import Descriptor, Features
from csm.descriptors.wks import WaveBand
from csm.errors import ConfigError
from csm.operators.operators import Operators

LengthUnit: TypeAlias = Literal["original", "unit_area"]


@dataclass(frozen=True)
class AMKS(Descriptor):
    r"""Chance that a quantum particle of log-energy e, put at a point, is found there again, averaged over a time T.

    .. math::
        m_e(x) = \frac{\sum_{a, b = 1}^{K} \phi_a(x)^2 \, f_e(\lambda_a) f_e(\lambda_b) \,
        \mathrm{sinc}(T (\lambda_a - \lambda_b)) \, \phi_b(x)^2}{\sum_{a \le b} f_e(\lambda_a) f_e(\lambda_b)}, \qquad
        f_e(\lambda) = \exp\left(-\frac{(e - \log \lambda)^2}{2 \sigma^2}\right),

    with sinc(z) = sin(z) / z.  Towards T = 0 this is the square of a wave kernel signature; for large T only a = b
    remains.

    Parameters
    ----------
    k
        K, number of eigenpairs.
    n_energies
        Number of energies, so of columns; evenly spaced from log lambda_2 to log(lambda_K) / 1.02.
    variance
        Width sigma of the window around an energy, in steps between energies.
    time
        T, in units of area; 0.5 is the default of the authors' code.
    units
        A guess, because T is an absolute time and no source says in which unit the shapes were.  ``"original"``: that
        of the file the mesh was read from, as the authors' code does with whatever it is given; the same shape in
        metres and in millimetres then has different descriptors.  ``"unit_area"``: the surface area is 1, so scale
        plays no part; the default K and T are then close to the limit of infinite time.

    Raises
    ------
    ConfigError
        If `k` or `n_energies` is below 2, `variance` is not positive, `time` is negative, or `units` is unknown.

    Notes
    -----
    K, T, the energies and the variance are those of the authors' code and its demonstration; the publications that
    compare with it give no settings.  As there, the logarithm of zero eigenvalues is that of 1e-6.

    References
    ----------
    Cosmo, Minello, Bronstein, Rossi, Torsello, "The average mixing kernel signature", ECCV 2020.
    """

    k: int = 100
    n_energies: int = 100
    variance: float = 6.0
    time: float = 0.5
    units: LengthUnit = "original"

    name: ClassVar[str] = "amks"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(0, "time")
        self.require_at_least(2, "k", "n_energies")
        self.require(self.variance > 0, "variance", "a number above 0")

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, n_energies), in units of 1/area^2 of the chosen unit of length."""
        spectrum = operators.lbo(self.k)
        # The area of one unit square of the chosen unit, measured in that of the operators.
        square = spectrum.mass.sum() if self.units == "unit_area" else operators.mesh.scale**-2
        evals = spectrum.evals * square
        band = energy_band(evals[spectrum.n_zero()], evals[-1], self.n_energies, self.variance)
        values = average_mixing_kernel_signature(evals, spectrum.evecs**2 * square, band, self.time)
        return Features(values, tuple(f"e={e:.3f}" for e in band.energies))


def energy_band(first: float, last: float, n: int, variance: float) -> WaveBand:
    """Return `n` log-energies from that of the `first` non-zero eigenvalue to almost that of the `last`.

    Raises
    ------
    ConfigError
        If the eigenvalues span no range of energies.
    """
    low, high = float(np.log(first)), float(np.log(last)) / 1.02
    if high <= low:
        raise ConfigError(f"the eigenvalues from {first:.3g} to {last:.3g} span no range of energies; raise k")
    return WaveBand(np.linspace(low, high, n), variance * (high - low) / (n - 1))


def average_mixing_kernel_signature(
    evals: FloatArray, densities: FloatArray, band: WaveBand, time: float
) -> FloatArray:
    """Return the average mixing kernel at every vertex and energy, (N, E), one energy at a time.

    Parameters
    ----------
    evals
        Shape (K,).
    densities
        Shape (N, K), the squared eigenfunctions.
    band
        E energies and the width of the window around each.
    time
        T, in the inverse unit of `evals`.
    """
    mixing = np.sinc(time * (evals[:, None] - evals) / np.pi)
    distance = band.energies[:, None] - np.log(np.maximum(evals, 1e-6))
    # Relative to the nearest eigenvalue, so that windows far from all do not vanish; the norm cancels the factor.
    exponents = -(distance**2) / (2 * band.sigma**2)
    windows = np.exp(exponents - exponents.max(axis=1, keepdims=True))
    values = np.empty((len(densities), len(windows)))
    for column, window in enumerate(windows):
        norm = (window.sum() ** 2 + (window**2).sum()) / 2
        kernel = mixing * np.outer(window, window) / norm
        values[:, column] = np.einsum("nk,nk->n", densities @ kernel, densities)
    return values
