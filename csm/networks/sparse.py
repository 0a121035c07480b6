"""Products with sparse matrices that do not learn, and filters that are polynomials of them.

The gradient of a matrix is never wanted; that of what it is multiplied with is made with the transposed matrix.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor
from torch.autograd.function import once_differentiable


class Csr(NamedTuple):
    """A sparse matrix with N rows in CSR form: `indptr` (N + 1,), `indices` (nnz,), both int64, and `values` (nnz,)."""

    indptr: Tensor
    indices: Tensor
    values: Tensor

    def times(self, x: Tensor) -> Tensor:
        """Return the product with `x`, shape (M, C), without a gradient.

        A sum of weighted rows is what an embedding bag is, too, and its kernel is the fastest that PyTorch has on a
        processor: at 64 channels twice as fast as a sparse tensor.
        """
        weights = self.values.to(x.dtype)
        return F.embedding_bag(
            self.indices, x.detach(), self.indptr, mode="sum", per_sample_weights=weights, include_last_offset=True
        )


def spmm(matrix: Csr, x: Tensor, transposed: Csr) -> Tensor:
    """Multiply a sparse matrix, shape (N, M), with `x`, shape (M, C); the gradient goes to `x` alone.

    `transposed` is the same matrix with rows and columns exchanged, shape (M, N), which the gradient goes through.
    """
    y: Tensor = _Product.apply(x, matrix, transposed)  # type: ignore[no-untyped-call]
    return y


def symmetric_matrix(indptr: Tensor, indices: Tensor, values: Tensor) -> Tensor:
    """Return a symmetric matrix in the form that `chebyshev_filter` wants: a sparse tensor, (N, N), of int32 indices.

    With these the product that adds to what is there, of the recursion of Chebyshev polynomials, runs in the kernel;
    it is twice as fast as `Csr.times` at 64 channels.
    """
    n = len(indptr) - 1
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sparse CSR tensor support is in beta", UserWarning)
        return torch.sparse_csr_tensor(indptr.int(), indices.int(), values, (n, n), check_invariants=False)


def chebyshev_filter(x: Tensor, weight: Tensor, matrices: Sequence[Tensor]) -> Tensor:
    r"""Return the sum over j and k of T_k(M_j) x W_kj, with the Chebyshev polynomials T_0 .. T_{K-1}.

    With V_kj = T_k(M_j) dy the gradients are the sum of V_kj W_kj^T, and x^T V_kj, so the backward pass makes the
    recursion of the forward pass, and nothing but `x` and `weight` is kept in between.  One matrix at a time stays in
    the cache.

    Parameters
    ----------
    x
        Shape (N, C_in).
    weight
        Shape (K, J, C_in, C_out).
    matrices
        J symmetric matrices, (N, N), of `symmetric_matrix`, with their spectra in [-1, 1].

    Returns
    -------
    Tensor
        Shape (N, C_out).
    """
    y: Tensor = _ChebyshevFilter.apply(x, weight, matrices)  # type: ignore[no-untyped-call]
    return y


def chebyshev_functions(matrix: Tensor, x: Tensor, terms: int) -> Iterator[Tensor]:
    """Yield T_1(M) x .. T_{terms-1}(M) x, shape (N, C) each; what is yielded next but one overwrites it."""
    if terms < 2:
        return
    before = x.clone(memory_format=torch.contiguous_format)
    now = torch.addmm(before, matrix, before, beta=0)
    yield now
    for _ in range(2, terms):
        torch.addmm(before, matrix, now, beta=-1, alpha=2, out=before)
        before, now = now, before
        yield now


class _Product(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, matrix: Csr, transposed: Csr) -> Tensor:
        ctx.transposed = transposed
        return matrix.times(x)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        return ctx.transposed.times(dy.contiguous()), None, None


class _ChebyshevFilter(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, matrices: Sequence[Tensor]) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.matrices = matrices
        y = x @ weight[0].sum(0)
        for j, matrix in enumerate(matrices):
            for k, function in enumerate(chebyshev_functions(matrix, x, len(weight)), 1):
                y.addmm_(function, weight[k, j])
        return y

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        x, weight = ctx.saved_tensors
        dw = torch.empty_like(weight)
        dw[0] = x.T @ dy
        dx = dy @ weight[0].sum(0).T if ctx.needs_input_grad[0] else None
        for j, matrix in enumerate(ctx.matrices):
            for k, function in enumerate(chebyshev_functions(matrix, dy, len(weight)), 1):
                torch.mm(x.T, function, out=dw[k, j])
                if dx is not None:
                    dx.addmm_(function, weight[k, j].T)
        return dx, dw, None
