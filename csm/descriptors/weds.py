"""The wavelet energy decomposition signature (WEDS)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm._types import Float32Array, FloatArray, IntArray
from csm.descriptors.base import Descriptor, Features
from csm.operators.filters import filter_names, mexican_hat_filters
from csm.operators.operators import Operators

_BLOCK = 256  # columns of the N x N wavelets that are held at a time
_NEGLIGIBLE = 1e-9  # of a filter's greatest value: float32 would not feel it, but denormal numbers are slow


@dataclass(frozen=True)
class WEDS(Descriptor):
    r"""Energy of the surface's own coordinates in wavelet bands, gathered around every point by wavelets.

    With the filters g_s of `csm.operators.filters.mexican_hat_filters`, the coordinates' coefficients
    c_m = sum_v a_v phi_m(v) x_v, and w_m = lambda_m^2 sum_l g_l(lambda_m)^2, the energy of band s at a vertex v is

    .. math:: E_s(v) = \Bigl| a_v \sum_m w_m g_s(\lambda_m) c_m \phi_m(v) \cdot
              \sum_m g_s(\lambda_m) c_m \phi_m(v) \Bigr|^{1/2}.

    For each of a few filters r the wavelet at x, psi_{r,x}(v) = sum_m g_r(lambda_m) phi_m(x) phi_m(v), gathers them:

    .. math:: f_{r,s}(x) = \frac{\sum_v \psi_{r,x}(v)^2 E_s(v)}{(\sum_v \psi_{r,x}(v)^4)^{1/2}}.

    Parameters
    ----------
    k
        Number of eigenpairs that are not constant, at least 2.
    n_filters
        S, the low-pass function and S - 1 wavelets.
    levels
        How many filters gather, spread evenly from fine to coarse between the last and the first; the published 4 of
        32 are numbers 25, 19, 13 and 7, counted from 1.

    Raises
    ------
    ConfigError
        If a parameter is out of its range: S must be at least `levels` + 2.

    Notes
    -----
    Coordinates enter through sums that rigid motions do not change, but bending does: this signature is not strictly
    intrinsic.  It is blind to reflections.  With a_v under the root and the fourth power in the denominator it keeps
    its size when the surface is sampled anew.  The N x N wavelets are made in float32, `_BLOCK` columns at a time.

    References
    ----------
    Wang, Ren, Yan, Guo, Zhang, Wonka, "MGCN: descriptor learning using multiscale GCNs", TOG (SIGGRAPH) 2020, and its
    published code, whose weight is lambda^2.

    Examples
    --------
    >>> len(WEDS().columns), WEDS().columns[0]
    (128, 'level 25 low-pass')
    """

    k: int = 300
    n_filters: int = 32
    levels: int = 4

    name: ClassVar[str] = "weds"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(1, "levels")
        self.require_at_least(2, "k")
        least = self.levels + 2
        self.require(self.n_filters >= least, "n_filters", f"{least} or more, which is 2 more than levels")

    @property
    def eigenpairs(self) -> int:
        """K and the constant one."""
        return self.k + 1

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: for each gathering filter, counted from 1, all bands from coarse to fine."""
        bands = filter_names(self.n_filters)
        return tuple(f"level {r + 1} {band}" for r in gathering_filters(self.n_filters, self.levels) for band in bands)

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, levels S), without unit."""
        spectrum = operators.lbo(self.eigenpairs)
        kept = slice(spectrum.n_zero(), None)
        evals, evecs = spectrum.evals[kept], spectrum.evecs[:, kept]
        filters = mexican_hat_filters(evals, self.n_filters, float(evals[-1]))
        energies = wavelet_energies(evals, evecs, spectrum.mass, operators.mesh.vertices, filters)
        gathering = filters[:, gathering_filters(self.n_filters, self.levels)]
        return Features(aggregate(evecs, gathering, energies), self.columns)


def gathering_filters(n: int, levels: int) -> IntArray:
    """Return the 0-based numbers of the filters that gather: `levels` of `n`, fine to coarse, without the ends."""
    return np.floor(np.linspace(n, 1, levels + 2)[1:-1]).astype(np.int64) - 1


def wavelet_energies(
    evals: FloatArray, evecs: FloatArray, mass: FloatArray, vertices: FloatArray, filters: FloatArray
) -> FloatArray:
    """Return the energy E_s(v) of `WEDS` for every vertex and filter, (N, S); it has no unit.

    Parameters
    ----------
    evals, evecs, mass
        Eigenpairs without the constant ones, shapes (K,) and (N, K), and the vertex areas, shape (N,).
    vertices
        Shape (N, 3).
    filters
        Values at the eigenvalues, shape (K, S).
    """
    coefficients = evecs.T @ (mass[:, None] * vertices)
    bands = filters[:, :, None] * coefficients[:, None, :]
    weights = evals**2 * (filters**2).sum(axis=1)
    plain, weighted = (
        (evecs @ b.reshape(len(evals), -1)).reshape(len(mass), -1, 3) for b in (bands, weights[:, None, None] * bands)
    )
    product: FloatArray = mass[:, None] * np.einsum("vsc,vsc->vs", plain, weighted)
    return np.sqrt(np.abs(product))


def aggregate(evecs: FloatArray, filters: FloatArray, energies: FloatArray) -> FloatArray:
    """Return, for every filter r and energy s, the sum over v of psi_{r,x}(v)^2 E_s(v) over the norm of psi_{r,x}^2.

    Parameters
    ----------
    evecs
        Shape (N, K).
    filters
        The gathering filters at the eigenvalues, shape (K, R).
    energies
        Shape (N, S).

    Returns
    -------
    FloatArray
        Shape (N, R S), filter by filter.  Only N x `_BLOCK` wavelet values exist at a time, in float32.
    """
    n, n_energies = energies.shape
    values = np.empty((n, filters.shape[1], n_energies))
    # Sizes are put back or cancel in the norm; float32 wants numbers near 1.
    basis, responses = (_largest_one(a, axis) for a, axis in ((evecs, None), (filters, 0)))
    gathered = _largest_one(energies, 0)
    for r, response in enumerate(responses.T):
        felt = response > _NEGLIGIBLE
        passed, filtered = basis[:, felt], basis[:, felt] * response[felt]
        for start in range(0, n, _BLOCK):
            rows = slice(start, start + _BLOCK)
            squares = (passed[rows] @ filtered.T) ** 2
            norm = np.linalg.norm(squares, axis=1, keepdims=True)
            values[rows, r] = (squares @ gathered) / np.where(norm > 0, norm, 1.0)
    restored: FloatArray = values * energies.max(axis=0)
    return restored.reshape(n, -1)


def _largest_one(values: FloatArray, axis: int | None) -> Float32Array:
    """Return the values in float32, over the greatest magnitude of each column, or of all (`axis` None)."""
    greatest = np.abs(values).max(axis=axis)
    return (values / np.where(greatest > 0, greatest, 1.0)).astype(np.float32)
