"""The anisotropic spectral manifold wavelet descriptor (ASMWD)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm._types import FloatArray
from csm.descriptors.acd import unit_rows
from csm.descriptors.angular import ByAngle
from csm.descriptors.base import Features
from csm.operators.filters import filter_names, meyer_filters, unit_sums
from csm.operators.frames import FrameKind
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum


@dataclass(frozen=True)
class ASMWD(ByAngle):
    r"""Meyer wavelets of the anisotropic spectrum, each at its own centre; one block of columns per angle.

    For the angle theta_j = pi j / J, the eigenpairs of B(alpha, theta_j) and the filters g_s of
    `csm.operators.filters.meyer_filters` up to lambda_K, divided by their sum over the K eigenvalues,

    .. math:: f_{j,s}(x) = \sum_{k=1}^{K} g_s(\lambda_k) \, \phi_k(x)^2, \qquad s = 1 \ldots S.

    Parameters
    ----------
    alpha
        Strength, at least 0.  At 0 every angle has the same Laplacian, so `angles` must then be 1.
    angles
        J, spread evenly over [0, pi) with the end left out.  Left and right differ only from J = 3 on.
    k
        K, eigenpairs per angle, at least 2.  A guess between two: the published code runs 100, but its comment calls
        300 the default.
    n_filters
        S, the low-pass function and S - 1 wavelets per angle, at least 2.
    normalise
        Scale each row to unit length.
    frame, sweeps, smoothing
        Of `csm.operators.frames.face_frames`.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    Block j of a mirror image is block -j mod J of the original.  At the defaults the low-pass function ends below the
    first eigenvalue that is not zero, so its column is constant up to the scale of the row.

    References
    ----------
    Li, Hu, Liu, Wang, Liu, Xin, "Anisotropic spectral manifold wavelet descriptor", CGF 2021, and its published code.

    Examples
    --------
    >>> len(ASMWD().columns), ASMWD().columns[11]
    (80, 'theta=0.393 wavelet 1')
    """

    alpha: float = 10.0
    angles: int = 8
    k: int = 100
    n_filters: int = 10
    normalise: bool = True
    frame: FrameKind = "line_field"
    sweeps: int = 3
    smoothing: float = 0.08

    name: ClassVar[str] = "asmwd"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(0, "alpha")
        self.require_at_least(1, "angles")
        self.require_at_least(2, "k", "n_filters")
        self._require_different_angles()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the J S columns, angle by angle."""
        return tuple(f"theta={theta:.3f} {name}" for theta in self.thetas for name in filter_names(self.n_filters))

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, J S), in units of 1/area unless normalised."""
        values = np.hstack([meyer_block(spectrum, self.n_filters) for spectrum in self._spectra(operators)])
        return Features(unit_rows(values) if self.normalise else values, self.columns)


def meyer_block(spectrum: Spectrum, n_filters: int) -> FloatArray:
    """Return sum_k g(lambda_k) phi_k^2 for the Meyer filters g, each of unit sum over the spectrum, (N, n_filters).

    Raises
    ------
    NumericalError
        If lambda_K is zero, because the mesh has K components or more.
    """
    greatest = float(spectrum.evals[spectrum.n_zero() :].max())
    return spectrum.evecs**2 @ unit_sums(meyer_filters(spectrum.evals, n_filters, greatest))
