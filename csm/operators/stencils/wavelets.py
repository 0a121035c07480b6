"""The stencil "wavelets", for MGCN: spectral wavelets of many scales and the vertices that they reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy import sparse

from csm._types import Arrays, BoolArray, Float32Array, FloatArray, IntArray
from csm.errors import ConfigError
from csm.operators.filters import mexican_hat_filters
from csm.operators.operators import Operators
from csm.operators.stencils.base import Stencil

_NEGLIGIBLE = 1e-9  # of a filter's greatest value: float32 would not feel it, but denormal numbers are slow
_GRAIN = 128  # that counts of vertices are rounded up to: matrix kernels are generated once for every size that occurs
_LEVELS = 160  # of size, four per octave: weights down to 2^-40 are told apart


@dataclass(frozen=True)
class Wavelets(Stencil):
    r"""The sixteen wavelets of MGCN, and for patches of vertices the vertices that their fourth powers reach.

    With the symmetric kernel :math:`\psi_s(i, j) = \sum_m g_s(\lambda_m) \phi_m(i) \phi_m(j)` the operators of MGCN are

    .. math:: G_s(i, j) = \psi_s(i, j)^4 / \sum_l \psi_s(l, j)^4 ,

    since squaring, dividing columns by their Euclidean norm and squaring again leaves columns that sum to 1.  Vertex
    areas, which multiply the columns of :math:`\Phi g(\Lambda) \Phi^\top A`, cancel in that division; they enter
    through the eigenfunctions alone.

    Sixteen N x N matrices are too much to keep, so the arrays say how to make the entries that matter: the factors of
    the kernel, a partition of the vertices into patches, and for every patch and wavelet a set of vertices outside of
    which no column of the patch has more than `tolerance` of its sum.  Sets of a patch are nested from the smallest to
    the greatest, so that each is a first part of one list.  What each column has outside, its `dropped` share, comes
    along, so that a network can let the average over all vertices stand for it.

    Parameters
    ----------
    k
        Number of eigenpairs that are not constant, at least 2.
    n_filters
        S of the bank of `csm.operators.filters.mexican_hat_filters`; every second one from the last, the finest, down
        to the second is used.
    tolerance
        What may be dropped of a column's sum, from 0 (nothing is dropped) to less than 1.
    patch
        Vertices per patch, roughly; smaller patches reach less and cost more overhead.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    References
    ----------
    Wang, Ren, Yan, Guo, Zhang, Wonka, "MGCN: descriptor learning using multiscale GCNs", TOG (SIGGRAPH) 2020, and its
    published code.
    """

    k: int
    n_filters: int
    tolerance: float
    patch: int = 100

    name: ClassVar[str] = "wavelets"

    def __post_init__(self) -> None:
        if self.k < 2 or self.n_filters < 2 or self.patch < 1 or not 0 <= self.tolerance < 1:
            raise ConfigError(f"{self}: wanted k >= 2, n_filters >= 2, patch >= 1 and 0 <= tolerance < 1")

    def __call__(self, operators: Operators) -> Arrays:
        """Return the arrays, with S wavelets from fine to coarse and B patches.

        `evecs` (N, K) and `responses` (K, S), with which the greatest value of every kernel is 1; `rows` (N,) the
        vertices patch by patch and `row_ends` (B,) where each patch ends in it; `columns` and `column_ends` (B,) the
        same for the vertices that a patch reaches; `extents` (B, S) how many of these each wavelet uses; `dropped`
        (N, S), in the order of `rows`, what this leaves out of the column's sum 1.
        """
        spectrum = operators.lbo(self.k + 1)
        kept = slice(spectrum.n_zero(), None)
        evals, evecs = spectrum.evals[kept], spectrum.evecs[:, kept]
        filters = mexican_hat_filters(evals, self.n_filters, float(evals[-1]))[:, self.n_filters - 1 : 0 : -2]
        filters = np.where(filters < _NEGLIGIBLE * filters.max(axis=0), 0.0, filters)
        responses = filters / np.max(evecs**2 @ filters, axis=0)  # the greatest entries lie on the diagonal
        factors = evecs.astype(np.float32), responses.astype(np.float32)
        patches = partition(evecs / np.sqrt(evals), self.patch)
        reaches = [reach(*factors, patch, self.tolerance) for patch in patches]
        return {
            "evecs": factors[0],
            "responses": factors[1],
            "rows": np.concatenate(patches),
            "row_ends": np.cumsum([len(patch) for patch in patches]),
            "columns": np.concatenate([r.columns for r in reaches]),
            "column_ends": np.cumsum([len(r.columns) for r in reaches]),
            "extents": np.array([r.extents for r in reaches]),
            "dropped": np.concatenate([r.dropped for r in reaches]),
        }


class Reach(NamedTuple):
    """The vertices that the wavelets at a patch of R vertices reach.

    Shapes: `columns` (Q,) vertices, `extents` (S,) how many of the first of them each wavelet uses, `dropped` (R, S)
    what this leaves out of each column's sum 1.
    """

    columns: IntArray
    extents: IntArray
    dropped: Float32Array


def partition(embedding: FloatArray, size: int) -> list[IntArray]:
    """Split points into compact parts of almost equal number, by halves across the direction of greatest variance.

    Parameters
    ----------
    embedding
        Shape (N, D).
    size
        Points per part: the number of halvings is the one that comes closest, in ratio.
    """
    n = len(embedding)
    parts: list[IntArray] = [np.arange(n)]
    for _ in range(max(0, round(float(np.log2(n / size))))):
        parts = [half for part in parts for half in _halves(embedding, part)]
    return parts


def _halves(embedding: FloatArray, part: IntArray) -> list[IntArray]:
    centred = embedding[part] - embedding[part].mean(axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    order = np.argsort(centred @ axis, kind="stable")
    return [np.sort(part[half]) for half in np.array_split(order, 2)]


def reach(evecs: Float32Array, responses: Float32Array, patch: IntArray, tolerance: float) -> Reach:
    """Return what the wavelets at the vertices of a patch reach but for `tolerance` of each one's sum.

    Parameters
    ----------
    evecs, responses
        Shapes (N, K) and (K, S).
    patch
        Indices of vertices.
    tolerance
        As of `Wavelets`.
    """
    weights = [fourth_powers(evecs, response, patch) for response in responses.T]
    kept = np.array([substantial(w, tolerance) for w in weights])
    order = np.argsort(kept.sum(axis=1), kind="stable")
    nested = np.logical_or.accumulate(kept[order], axis=0)
    first = (~nested).sum(axis=0)  # the first of the nested sets that has the vertex
    extents = np.empty(len(kept), dtype=np.int64)
    extents[order] = np.minimum(-(-nested.sum(axis=1) // _GRAIN) * _GRAIN, nested[-1].sum())
    columns = np.argsort(first, kind="stable")[: extents.max()]
    dropped = np.stack([1 - w[columns[:n]].sum(axis=0) for w, n in zip(weights, extents, strict=True)], axis=1)
    return Reach(columns, extents, np.clip(dropped, 0, 1))


def fourth_powers(evecs: Float32Array, response: Float32Array, patch: IntArray) -> Float32Array:
    """Return the columns `patch` of the operator G of one wavelet, each with sum 1 (or 0 throughout)."""
    used = slice(0, 1 + int(np.flatnonzero(response).max(initial=-1)))
    powers: Float32Array = evecs[:, used] @ (evecs[patch, used] * response[used]).T
    powers *= powers
    powers *= powers >= 1e-15  # less is rounding, and denormal when squared
    powers *= powers
    sums = powers.sum(axis=0)
    powers /= np.where(sums > 0, sums, np.float32(1))
    return powers


def substantial(weights: Float32Array, tolerance: float) -> BoolArray:
    """Tell the rows of `weights`, columns that sum to 1, without which a column would lose more than `tolerance`.

    Rows go by their greatest entry, the smallest first, in steps of a quarter of an octave.
    """
    greatest = weights.max(axis=1)
    with np.errstate(divide="ignore"):
        levels = np.clip(-4 * np.log2(greatest), 0, _LEVELS - 1).astype(np.int64)
    n = len(weights)
    members = sparse.csr_array((np.ones(n, weights.dtype), (levels, np.arange(n))), shape=(_LEVELS, n))
    lost = np.cumsum((members @ weights)[::-1], axis=0)[::-1].max(axis=1)
    kept: BoolArray = (greatest > 0) & (lost[levels] > tolerance)
    return kept
