"""The global point signature (GPS)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm.descriptors.base import Descriptor, Features
from csm.operators.operators import Operators


@dataclass(frozen=True)
class GPS(Descriptor):
    r"""Eigenfunctions that are not constant, each over the square root of its eigenvalue.

    .. math:: g_k(x) = \frac{|\phi_k(x)|}{\sqrt{\lambda_k}}, \qquad k = 2 \ldots K + 1.

    A reference, not a matcher: which of two close eigenvalues comes first, the basis within an eigenspace and the sign
    of every eigenfunction are accidents of one shape, so that column k of two shapes need not be the same function.

    Parameters
    ----------
    k
        K, number of columns.  A guess: 20 to 50 are common, and the source uses as many as there are.
    absolute
        Take absolute values, which removes the signs (and the difference between the two ends of an odd function).
        Without it the signs are those of `csm.operators.spectrum.Spectrum`, which two shapes do not share.

    Raises
    ------
    ConfigError
        If `k` is below 1.

    Notes
    -----
    Without unit: the scale of the shape plays no part, even without scaling to unit area.

    References
    ----------
    Rustamov, "Laplace-Beltrami eigenfunctions for deformation invariant shape representation", SGP 2007.
    """

    k: int = 20
    absolute: bool = True

    name: ClassVar[str] = "gps"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(1, "k")

    @property
    def eigenpairs(self) -> int:
        """K and the constant one."""
        return self.k + 1

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, k), without unit."""
        spectrum = operators.lbo(self.eigenpairs)
        zeros = spectrum.n_zero()
        if zeros > 1:  # a mesh of several components has that many constant functions
            spectrum = operators.lbo(self.k + zeros)
        values = spectrum.evecs[:, zeros:] / np.sqrt(spectrum.evals[zeros:])
        names = tuple(f"phi_{k}" for k in range(2, self.k + 2))
        return Features(np.abs(values) if self.absolute else values, names)
