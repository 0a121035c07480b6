"""Geometry vectors, the input of optimal spectral descriptors (OSD)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm.descriptors.acd import unit_rows
from csm.descriptors.base import Descriptor, Features
from csm.descriptors.geovec import geometry_vectors
from csm.operators.operators import Operators


@dataclass(frozen=True)
class GeometryVectors(Descriptor):
    r"""Squared eigenfunctions gathered by B-splines over the spectrum: the input of OSD's filters.

    For the isotropic Laplacian of a surface of area A and cubic B-splines B_i whose knots are evenly spaced up to R,

    .. math:: g_i(x) = \sum_{k=1}^{K} B_i(\lambda_k) \, \phi_k(x)^2, \qquad R = r \, \frac{4 \pi K}{A}.

    A linear layer on these columns weighs the spectrum by any filter that the splines span, heat and wave kernel
    signatures among them; `csm.networks.MLP` begins with one.

    Parameters
    ----------
    k
        K, eigenpairs, at least 2.
    n_splines
        S, splines, at least 2.
    reach
        r, where the last knot is, as a share of 4 pi K / A, the eigenvalue that Weyl's law expects last.  The inventors
        take the 99th percentile of the eigenvalues of their training shapes, which is r = 0.89 for bodies of FAUST and
        0.88 for the built-in humans.  A number in its place makes the knots the same for every shape without a look at
        any other.
    spline_shift
        Of `csm.descriptors.geovec.spline_weights`.  The inventors begin the first spline at 0 (a shift of 0).
    normalise
        Scale each row to unit length, as the inventors do.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    Blind to left and right, as all sums of squared eigenfunctions of the isotropic Laplacian.

    References
    ----------
    Litman, Bronstein, "Learning spectral descriptors for deformable shape correspondence", PAMI 2014, and its published
    code.

    Examples
    --------
    >>> len(GeometryVectors().columns), GeometryVectors().columns[0]
    (150, 'spline 1')
    """

    k: int = 300
    n_splines: int = 150
    reach: float = 0.89
    spline_shift: float = 0.0
    normalise: bool = True

    name: ClassVar[str] = "geometry_vectors"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(2, "k", "n_splines")
        self.require(self.reach > 0, "reach", "a number above 0")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the S columns."""
        return tuple(f"spline {i}" for i in range(1, self.n_splines + 1))

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, S), in units of 1/area unless normalised."""
        spectrum = operators.lbo(self.k)
        last = self.reach * 4 * np.pi * self.k / float(operators.mass.sum())
        step = last / (self.n_splines - 1)
        values = geometry_vectors(spectrum.evals, spectrum.evecs, self.n_splines, step, shift=self.spline_shift)
        return Features(unit_rows(values) if self.normalise else values, self.columns)
