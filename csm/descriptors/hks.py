"""The heat kernel signature (HKS)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from csm._types import FloatArray
from csm.descriptors.base import Descriptor, Features
from csm.errors import ParameterError
from csm.operators.operators import Operators


@dataclass(frozen=True)
class HKS(Descriptor):
    r"""Heat left at a point after a time t, for logarithmically spaced times.

    .. math:: h_t(x) = \sum_{k=1}^{K} e^{-\lambda_k t} \, \phi_k(x)^2

    with times from 4 ln 10 / lambda_K to 4 ln 10 / lambda_2, where lambda_2 is the first eigenvalue that is not zero,
    or between two given times.

    Parameters
    ----------
    k
        K, number of eigenpairs.
    n_times
        Number of times, so of columns.
    scaled
        Divide each column by the heat trace, the sum of exp(-lambda_k t).
    first, last
        First and last time, in units of the area, the same for every shape; None for those of the shape's spectrum.

    Raises
    ------
    ConfigError
        If `k` or `n_times` is below 2, only one of `first` and `last` is given, or they are not positive and ascending.

    References
    ----------
    Sun, Ovsjanikov, Guibas, "A concise and provably informative multi-scale signature based on heat diffusion",
    SGP 2009.  Fixed times: Sharp et al., "DiffusionNet: discretization agnostic learning on surfaces", TOG 2022.
    """

    k: int = 300
    n_times: int = 100
    scaled: bool = True
    first: float | None = None
    last: float | None = None

    name: ClassVar[str] = "hks"
    added: ClassVar[Mapping[str, Any]] = {"first": None, "last": None}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(2, "k", "n_times")
        if self._fixed is None and (self.first, self.last) != (None, None):
            name, other = ("last", "first") if self.first is None else ("first", "last")
            wanted = f"two times with 0 < first < last, or none of both; {other}={getattr(self, other)}"
            raise ParameterError(self.name, name, getattr(self, name), wanted)

    @property
    def _fixed(self) -> tuple[float, float] | None:
        """First and last time if they are given and make sense."""
        if self.first is None or self.last is None or not 0 < self.first < self.last:
            return None
        return self.first, self.last

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, n_times), in units of 1/area."""
        spectrum = operators.lbo(self.k)
        if self._fixed:
            times = np.geomspace(*self._fixed, self.n_times)
        else:
            times = heat_times(spectrum.evals[spectrum.n_zero()], spectrum.evals[-1], self.n_times)
        return Features(
            heat_kernel_signature(spectrum.evals, spectrum.evecs, times, scaled=self.scaled),
            tuple(f"t={t:.3g}" for t in times),
        )


def heat_times(first: float, last: float, n: int) -> FloatArray:
    """Return `n` logarithmically spaced times, ascending, from 4 ln 10 / `last` to 4 ln 10 / `first` eigenvalue."""
    scale = 4 * np.log(10)
    return np.geomspace(scale / last, scale / first, n)


def heat_kernel_signature(evals: FloatArray, evecs: FloatArray, times: FloatArray, *, scaled: bool) -> FloatArray:
    """Return sum_k exp(-lambda_k t) phi_k^2 for every vertex and time, (N, T), over the heat trace if `scaled`."""
    decay = np.exp(-np.outer(evals, times))
    if scaled:
        decay /= decay.sum(axis=0)
    return evecs**2 @ decay
