"""The wave kernel signature (WKS)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.special import softmax

from csm._types import FloatArray
from csm.descriptors.base import Descriptor, Features
from csm.errors import ConfigError
from csm.operators.operators import Operators

WaveVariant: TypeAlias = Literal["aubry", "functional_map"]


@dataclass(frozen=True)
class WKS(Descriptor):
    r"""Chance of meeting a quantum particle of log-energy e at a point, for evenly spaced e.

    .. math::
        w_e(x) = \frac{\sum_k f_e(\lambda_k) \phi_k(x)^2}{\sum_k f_e(\lambda_k)}, \qquad
        f_e(\lambda) = \exp\left(-\frac{(e - \log \lambda)^2}{2 \sigma^2}\right)

    Parameters
    ----------
    k
        K, number of eigenpairs.
    n_energies
        Number of energies, so of columns.
    variant
        ``"aubry"``: e from log lambda_2 to log(lambda_K) / 1.02, sigma six steps, zero eigenvalues kept with the
        logarithm of 1e-6 (unit area assumed).  ``"functional_map"``: sigma = 7 / n of the full range, which is then
        narrowed by 2 sigma at both ends, zero eigenvalues dropped.

    Raises
    ------
    ConfigError
        If `k` or `n_energies` is below 2, or the functional-map band is empty (n_energies of 28 or less).

    References
    ----------
    Aubry, Schlickewei, Cremers, "The wave kernel signature: a quantum mechanical approach to shape analysis", ICCV
    Workshops 2011, and the two parameter conventions in use since.
    """

    k: int = 300
    n_energies: int = 100
    variant: WaveVariant = "aubry"

    name: ClassVar[str] = "wks"

    def __post_init__(self) -> None:
        super().__post_init__()
        least = 29 if self.variant == "functional_map" else 2
        self.require_at_least(2, "k")
        self.require_at_least(least, "n_energies")

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, n_energies), in units of 1/area."""
        spectrum = operators.lbo(self.k)
        zeros = spectrum.n_zero()
        band = wave_band(spectrum.evals[zeros], spectrum.evals[-1], self.n_energies, self.variant)
        kept = slice(0 if self.variant == "aubry" else zeros, None)
        values = wave_kernel_signature(spectrum.evals[kept], spectrum.evecs[:, kept], band)
        return Features(values, tuple(f"e={e:.3f}" for e in band.energies))


class WaveBand(NamedTuple):
    """Log-energies (E,), ascending, and the width of the window around each."""

    energies: FloatArray
    sigma: float


def wave_band(first: float, last: float, n: int, variant: WaveVariant) -> WaveBand:
    """Return the `n` log-energies and the window width of a convention, from the first non-zero and last eigenvalue.

    Raises
    ------
    ConfigError
        If the eigenvalues span no range of energies.
    """
    low, high = float(np.log(first)), float(np.log(last))
    sigma = 6 * (high / 1.02 - low) / (n - 1) if variant == "aubry" else 7 * (high - low) / n
    if sigma <= 0:
        raise ConfigError(f"the eigenvalues from {first:.3g} to {last:.3g} span no range of energies; raise k")
    if variant == "aubry":
        return WaveBand(np.linspace(low, high / 1.02, n), sigma)
    return WaveBand(np.linspace(low + 2 * sigma, high - 2 * sigma, n), sigma)


def wave_kernel_signature(evals: FloatArray, evecs: FloatArray, band: WaveBand) -> FloatArray:
    """Return sum_k f_e(lambda_k) phi_k^2 / sum_k f_e(lambda_k) for every vertex and energy, (N, E)."""
    distance = band.energies - np.log(np.maximum(evals, 1e-6))[:, None]
    weights: FloatArray = softmax(-(distance**2) / (2 * band.sigma**2), axis=0)
    return evecs**2 @ weights
