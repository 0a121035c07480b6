"""The anisotropic Chebyshev descriptor (ACD)."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, ClassVar

import numpy as np

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.descriptors.angular import ByAngle
from csm.descriptors.base import Features, as_operators
from csm.descriptors.stack import Stack
from csm.mesh.debris import component_areas
from csm.mesh.inputs import MeshLike
from csm.operators.frames import FrameKind
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum

_log = logging.getLogger(__name__)

_SMALL = 500  # vertices of a mesh all of whose eigenpairs are taken where it has fewer than are asked for


@dataclass(frozen=True)
class ACD(ByAngle):
    r"""Chebyshev polynomials of the anisotropic spectrum, one block of columns per angle.

    For the angle theta_j = pi j / J and the eigenpairs of B(alpha, theta_j),

    .. math:: f_{j,d}(x) = \sum_{k=1}^{K} T_d(2 \lambda_k / \lambda_K - 1) \, \phi_k(x)^2, \qquad d = 0 \ldots D.

    Parameters
    ----------
    alpha
        Strength, at least 0.  At 0 every angle has the same Laplacian, so `angles` must then be 1.
    angles
        J, spread evenly over [0, pi) with the end left out.  Left and right differ only from J = 3 on.
    k
        K, eigenpairs per angle, at least 2.
    order
        D, so each angle has the D + 1 columns T_0 .. T_D per cut.
    cuts
        How often the sum is taken, each time with one eigenpair less: to K, K - 1, ...  The polynomials are scaled to
        the last eigenvalue of the sum, so where this one is close to the next, a small change of pose changes all
        columns; with several cuts not all of them at once.
    normalise
        Scale each row to unit length.
    frame, sweeps, smoothing
        Of `csm.operators.frames.face_frames`.
    damping
        The column of T_d is divided by (d + 1) to this power.  High degrees tell neighbours apart and change most
        from shape to shape.
    centred
        Subtract from each column its mean over the surface, which differs from pose to pose.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    The defaults are csm's own settings (640 columns): smooth frames, sums to 11, 10, 9 and 8 eigenpairs, T_0 .. T_7
    damped, centred.  They were chosen by nearest-neighbour matching of FAUST shapes 0 to 79 and of TOSCA's cats, dogs
    and wolves.  `paper` has the settings of the text of the paper (140 columns), `release` those of its published code
    (48 columns).

    Each component of a mesh has its own spectrum, and one with fewer vertices than K all the eigenpairs that it has,
    which is logged (the isotropic signatures refuse such a mesh).

    Block j of a mirror image is block -j mod J of the original.  Faces must be oriented outwards: inside out, convex
    and concave change places as well, and the block of theta is the original's of pi/2 - theta.

    Examples
    --------
    >>> len(ACD().columns), len(ACD.paper().columns), len(ACD.release().columns)
    (640, 140, 48)
    >>> ACD().columns[10], ACD.paper().columns[10]
    ('theta=0.000 K=10 T2', 'theta=0.157 T3')
    """

    alpha: float = 10.0
    angles: int = 20
    k: int = 11
    order: int = 7
    normalise: bool = False
    frame: FrameKind = "smooth"
    sweeps: int = 3
    smoothing: float = 0.08
    centred: bool = True
    cuts: int = 4
    damping: float = 0.5

    name: ClassVar[str] = "acd"
    added: ClassVar[Mapping[str, Any]] = {"damping": 0.0}
    by_component: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(0, "alpha", "order", "damping")
        self.require_at_least(1, "angles", "cuts")
        if self.cuts > type(self).cuts:  # more than usual, so it is what was asked for
            self.require(self.k > self.cuts, "cuts", f"fewer than k={self.k}, so that the last cut has 2 eigenpairs")
        self.require(self.k > self.cuts, "k", f"more than cuts={self.cuts}, so that the last cut has 2 eigenpairs")
        self._require_different_angles()

    @classmethod
    def paper(cls) -> ACD:
        """Return the settings of the paper's text: sums to 10 eigenpairs, T_0 .. T_6, neither damped nor centred."""
        return cls(k=10, order=6, frame="line_field", centred=False, cuts=1, damping=0.0)

    @classmethod
    def isotropic(cls) -> ACD:
        """Return the settings of the paper for the isotropic Laplacian: what ACD is without its angles."""
        return replace(cls.paper(), alpha=0.0, angles=1)

    @classmethod
    def release(cls, *, frame: FrameKind = "line_field", sweeps: int = 3) -> ACD:
        """Return the settings of the authors' code; with ``frame="released", sweeps=10`` also its frame."""
        return replace(cls.paper(), alpha=4.0, angles=8, k=70, order=5, normalise=True, frame=frame, sweeps=sweeps)

    @classmethod
    def two_bands(cls) -> Stack:
        """Return csm's own settings beside those of the authors' code with smooth frames: 688 columns for a network.

        The first sums the 8 to 11 lowest eigenpairs and tells limbs apart, the second sums 70 and tells neighbouring
        vertices apart.
        """
        return Stack({"low": cls(), "high": cls.release(frame="smooth")})

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, J (D + 1) per cut: angle by angle, cut by cut."""
        cuts = [""] if self.cuts == 1 else [f" K={k}" for k in self._ks]
        return tuple(
            f"theta={theta:.3f}{cut} T{d}" for theta in self.thetas for cut in cuts for d in range(self.order + 1)
        )

    @property
    def _ks(self) -> range:
        return range(self.k, self.k - self.cuts, -1)

    def mirrored_columns(self) -> IntArray:
        """Return where the columns of a mirror image are: those of the angle -theta, which is pi - theta.

        Raises
        ------
        ConfigError
            If the frame is "released", which depends on the axes of the world.
        """
        if self.frame == "released":
            return super().mirrored_columns()
        columns = np.arange(len(self.columns)).reshape(self.angles, -1)
        return columns[-np.arange(self.angles) % self.angles].ravel()

    def __call__(self, shape: MeshLike | Operators) -> Features:
        """Evaluate as every descriptor, and log it where a mesh has fewer eigenpairs than `k`."""
        operators = as_operators(shape)
        if operators.body is None:  # the body of a mesh with debris comes here by itself
            self._log_fewer(operators)
        return super().__call__(operators)

    def _log_fewer(self, operators: Operators) -> None:
        mesh, several = operators.mesh, operators.n_components > 1
        sizes = np.bincount(component_areas(mesh)[0]) if several else np.array([mesh.n_vertices])
        few = int((sizes < self.k).sum())
        self.require(self.k <= max(sizes.max(), _SMALL), "k", f"at most {sizes.max()}, the vertices of {mesh.label}")
        if few:
            short = counted(few, "component has", "components have") if several else "the mesh has"
            _log.warning(
                "%s: %s fewer vertices than the %s eigenpairs that are asked for (descriptor.k); acd takes as many as "
                "there are vertices (%s)",
                *(mesh.label, short, self.k, sizes.min()),
            )

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, one column per name, in units of 1/area unless normalised."""
        most = min(self.k, operators.mesh.n_vertices)  # a cube has 8 vertices, and no more eigenpairs
        spectra = self._spectra(operators, most)
        ks = [min(k, most) for k in self._ks]
        damping = np.arange(1.0, self.order + 2) ** -self.damping
        values = np.empty((operators.mesh.n_vertices, len(self.columns)))
        blocks = np.split(values, len(spectra) * len(ks), axis=1)  # filled in place: of a big mesh two copies are large
        for block, (spectrum, k) in zip(blocks, product(spectra, ks), strict=True):
            block[:] = chebyshev_block(spectrum.first(k), self.order) * damping
        if self.centred:
            values -= operators.mass @ values / operators.mass.sum()
        return Features(unit_rows(values) if self.normalise else values, self.columns)


def chebyshev_block(spectrum: Spectrum, order: int) -> FloatArray:
    """Return sum_k T_d(2 lambda_k / lambda_K - 1) phi_k^2 for d = 0 .. `order`, shape (N, order + 1).

    Raises
    ------
    NumericalError
        If lambda_K is zero, because the mesh has K components or more.
    """
    greatest = spectrum.evals[spectrum.n_zero() :].max()
    argument = 2 * spectrum.evals / greatest - 1
    weights: FloatArray = np.polynomial.chebyshev.chebvander(argument, order)
    return spectrum.evecs**2 @ weights


def unit_rows(values: FloatArray) -> FloatArray:
    """Scale each row to Euclidean length 1 (rows of zeros stay)."""
    length = np.linalg.norm(values, axis=1, keepdims=True)
    return values / np.where(length > 0, length, 1.0)
