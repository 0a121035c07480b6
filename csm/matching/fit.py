r"""Functional maps fitted to descriptors, with the regularisers of the field.

With A (K_t, Q) and B (K_s, Q) the coefficients of Q descriptors of the target and of the source, the map minimises

.. math::

   |C A - B|^2 + w_L |C \Lambda_t - \Lambda_s C|^2
   + w_D \sum_q |C X^t_q - X^s_q C|^2 + w_O \sum_{ij} |C \Omega^t_{ij} - \Omega^s_{ij} C|^2,

where Lambda are the eigenvalues, X_q multiplies a function by descriptor q (Nogneng and Ovsjanikov, "Informative
Descriptor Preservation via Commutativity", 2017), and Omega_q takes f to the pseudo-scalar n . (grad d_q x grad f)
(Ren et al., "Continuous and Orientation-preserving Correspondences via Functional Maps", 2018), which a mirrored map
turns into its negative.  All terms are divided by their size, so the weights are pure numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from csm._types import FloatArray
from csm.errors import ConfigError
from csm.matching.orientation import cross_gradients
from csm.mesh.shape import Mesh
from csm.operators.spectrum import Spectrum


@dataclass(frozen=True)
class FitWeights:
    """Weights of the terms beside the descriptors' own, which has 1; see the module.

    Parameters
    ----------
    laplacian
        w_L, of commuting with the Laplacians.
    descriptors
        w_D, of commuting with multiplication by the descriptors.
    orientation
        w_O, of commuting with their orientation operators; it needs the meshes.

    Raises
    ------
    ConfigError
        If one is negative.
    """

    laplacian: float = 0.1
    descriptors: float = 0.1
    orientation: float = 0.0

    def __post_init__(self) -> None:
        if not min(self.laplacian, self.descriptors, self.orientation) >= 0:
            raise ConfigError(f"{self}: wanted weights of at least 0")


@dataclass(frozen=True, eq=False)
class Side:
    """One of two shapes to fit a functional map between.

    Parameters
    ----------
    spectrum
        K eigenpairs at least.
    features
        Shape (N, Q), Q descriptors that correspond between the shapes, column by column, at comparable scales.
    mesh
        At the scale of the spectrum; needed by the orientation term only.
    """

    spectrum: Spectrum
    features: FloatArray
    mesh: Mesh | None = None


def fit_functional_map(source: Side, target: Side, k: int, weights: FitWeights | None = None) -> FloatArray:
    """Fit a functional map of K x K to corresponding descriptors, see the module for what is minimised.

    Parameters
    ----------
    source, target
        The shapes with their descriptors.
    k
        K.
    weights
        Of the regularisers.

    Returns
    -------
    FloatArray
        Shape (K, K), from coefficients on the target to coefficients on the source.

    Raises
    ------
    ConfigError
        If the numbers of descriptors differ, or a mesh is missing that the orientation term needs.

    Examples
    --------
    >>> import csm
    >>> operators = csm.Operators(csm.load_humans().mesh("s00_p00"))
    >>> side = Side(operators.lbo(6), operators.mesh.vertices)
    >>> bool(np.abs(fit_functional_map(side, side, 6) - np.eye(6)).max() < 1e-3)
    True
    """
    weights = weights or FitWeights()
    if source.features.shape[1] != target.features.shape[1]:
        raise ConfigError(
            f"{source.features.shape[1]} descriptors of the source and {target.features.shape[1]} of the target; "
            "wanted the same ones of both"
        )
    here, there = source.spectrum.first(k), target.spectrum.first(k)
    terms = _Terms(_coefficients(there, target.features), _coefficients(here, source.features))
    gaps = (here.evals[:, None] - there.evals[None, :]) ** 2
    terms.laplacian = weights.laplacian * gaps / max(float(gaps.mean()), 1e-300)
    if weights.descriptors > 0:
        terms.commute(_products(there, target.features), _products(here, source.features), weights.descriptors)
    if weights.orientation > 0:
        terms.commute(_turns(target, there), _turns(source, here), weights.orientation)
    return terms.minimiser()


class _Terms:
    """The quadratic energy of a K x K matrix, and its minimiser."""

    def __init__(self, target: FloatArray, source: FloatArray) -> None:
        k, size = len(target), max(float((target**2).sum()) / len(target), 1e-300)
        self.gram, self.right = target @ target.T / size, source @ target.T / size
        self.laplacian = np.zeros((k, k))
        self.pairs: list[tuple[float, FloatArray, FloatArray]] = []

    def commute(self, target: FloatArray, source: FloatArray, weight: float) -> None:
        """Add weight * mean over q of |C X_q - Y_q C|^2, with X (Q, K, K) of the target and Y of the source."""
        size = max(float((target**2).sum() + (source**2).sum()) / (2 * target.shape[1]), 1e-300)
        self.pairs.append((weight / size, target, source))

    def gradient(self, c: FloatArray) -> FloatArray:
        """Return half the gradient of the energy at C, without its constant part."""
        out = c @ self.gram + self.laplacian * c
        for weight, x, y in self.pairs:
            rest = c @ x - y @ c
            out = out + weight * (
                np.einsum("qik,qjk->ij", rest, x, optimize=True) - np.einsum("qki,qkj->ij", y, rest, optimize=True)
            )
        return out

    def minimiser(self) -> FloatArray:
        """Solve the normal equations by conjugate gradients."""
        k = len(self.gram)
        ridge = 1e-9 * max(float(np.trace(self.gram)) / k, 1e-300)

        def apply(vector: FloatArray) -> FloatArray:
            c = vector.reshape(k, k)
            return (self.gradient(c) + ridge * c).ravel()

        operator = LinearOperator((k * k, k * k), matvec=apply, dtype=np.float64)
        solution, _ = cg(operator, self.right.ravel(), rtol=1e-10, maxiter=20 * k)
        found: FloatArray = np.asarray(solution).reshape(k, k)
        return found


def _coefficients(spectrum: Spectrum, features: FloatArray) -> FloatArray:
    return spectrum.evecs.T @ (spectrum.mass[:, None] * features)


def _products(spectrum: Spectrum, features: FloatArray) -> FloatArray:
    """Return the operators that multiply by each descriptor, shape (Q, K, K), in the eigenbasis."""
    weighted = spectrum.evecs * spectrum.mass[:, None]
    return np.stack([weighted.T @ (column[:, None] * spectrum.evecs) for column in features.T])


def _turns(side: Side, spectrum: Spectrum) -> FloatArray:
    """Return the operators f -> n . (grad d_q x grad f), shape (Q, K, K), in the eigenbasis."""
    if side.mesh is None:
        raise ConfigError("the orientation term needs the meshes: Side(spectrum, features, mesh)")
    weighted = spectrum.evecs * spectrum.mass[:, None]
    smooth = spectrum.evecs @ _coefficients(spectrum, side.features)
    turned = cross_gradients(side.mesh, smooth, spectrum.evecs)  # (N, Q, K)
    operators: FloatArray = np.einsum("nk,nql->qkl", weighted, turned, optimize=True)
    return operators
