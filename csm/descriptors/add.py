"""Oriented geometry vectors, the input of anisotropic diffusion descriptors (ADD)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm._types import FloatArray
from csm.descriptors.acd import unit_rows
from csm.descriptors.angular import ByAngle
from csm.descriptors.base import Features
from csm.descriptors.geovec import geometry_vectors
from csm.operators.frames import FrameKind
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum


@dataclass(frozen=True)
class ADD(ByAngle):
    r"""Geometry vectors of the anisotropic spectrum, one block of columns per angle: the input of ADD's filters.

    For the angle theta_j = pi j / J, the eigenpairs of B(alpha, theta_j) and cubic B-splines B_i over [0, lambda_K],

    .. math:: f_{j,i}(x) = \sum_{k=1}^{K} B_i(\lambda_k) \, \phi_k(x)^2, \qquad i = 1 \ldots S.

    A linear layer on these columns is a filter per angle, which is what `csm.networks.MLP` begins with.

    Parameters
    ----------
    alpha
        Strength, at least 0.  At 0 every angle has the same Laplacian, so `angles` must then be 1.  A guess: the code
        of ADD was not available; 100 is what its authors' later code for ACNN runs.
    angles
        J, spread evenly over [0, pi) with the end left out.  A guess: 16 is from the same code.
    k
        K, eigenpairs per angle, at least 2.  A guess, a plain round number.
    n_splines
        S, splines per angle, at least 2.  A guess: with 16 there are 256 columns.
    spline_shift
        Of `csm.descriptors.geovec.spline_weights`.  A guess: 2 centres the first spline at 0 and the last at lambda_K.
        The inventors of geometry vectors begin the first one at 0 (a shift of 0), which with 16 splines instead of
        their 150 would leave the lowest eigenvalues out of every column, and the last column empty.
    normalise
        Scale each row to unit length.  A guess: the inventors of geometry vectors do.
    frame, sweeps, smoothing
        Of `csm.operators.frames.face_frames`.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    The knots are a guess, too: evenly spaced up to each angle's own lambda_K, where geometry vectors have one range for
    a whole training set.  So no column depends on any other shape.

    Block j of a mirror image is block -j mod J of the original.

    References
    ----------
    Boscaini, Masci, Rodola, Bronstein, Cremers, "Anisotropic diffusion descriptors", CGF (Eurographics) 2016.

    Examples
    --------
    >>> len(ADD().columns), ADD().columns[17]
    (256, 'theta=0.196 spline 2')
    """

    alpha: float = 100.0
    angles: int = 16
    k: int = 100
    n_splines: int = 16
    spline_shift: float = 2.0
    normalise: bool = True
    frame: FrameKind = "line_field"
    sweeps: int = 3
    smoothing: float = 0.08

    name: ClassVar[str] = "add"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(0, "alpha")
        self.require_at_least(1, "angles")
        self.require_at_least(2, "k", "n_splines")
        self._require_different_angles()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the J S columns, angle by angle."""
        return tuple(f"theta={theta:.3f} spline {i}" for theta in self.thetas for i in range(1, self.n_splines + 1))

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, J S), in units of 1/area unless normalised."""
        values = np.hstack([self._block(spectrum) for spectrum in self._spectra(operators)])
        return Features(unit_rows(values) if self.normalise else values, self.columns)

    def _block(self, spectrum: Spectrum) -> FloatArray:
        greatest = float(spectrum.evals[spectrum.n_zero() :].max())
        step = greatest / (self.n_splines - 1)
        return geometry_vectors(spectrum.evals, spectrum.evecs, self.n_splines, step, shift=self.spline_shift)
