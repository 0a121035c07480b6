"""Products with sparse matrices that do not learn, and filters that are polynomials of them.

A matrix is three tensors in CSR form, as stencils have it: `indptr` (N + 1,), `indices` (nnz,) and `values` (nnz,).
Its gradient is never wanted; that of what it is multiplied with is made with the transposed matrix.
"""

from __future__ import annotations

from collections.abc import Iterator
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


def spmm(
    indptr: Tensor,
    indices: Tensor,
    values: Tensor,
    x: Tensor,
    transposed: tuple[Tensor, Tensor, Tensor] | None = None,
) -> Tensor:
    """Multiply a sparse matrix with `x`; the gradient goes to `x` alone.

    Parameters
    ----------
    indptr, indices, values
        The matrix, shape (N, M).
    x
        Shape (M, C).
    transposed
        The same three of the transposed matrix; None if the matrix is symmetric.

    Returns
    -------
    Tensor
        Shape (N, C).
    """
    matrix = Csr(indptr, indices, values)
    other = matrix if transposed is None else Csr(*transposed)
    y: Tensor = _Product.apply(x, matrix, other)  # type: ignore[no-untyped-call]
    return y


def chebyshev_filter(
    indptr: Tensor,
    indices: Tensor,
    values: Tensor,
    x: Tensor,
    weight: Tensor,
    transposed: tuple[Tensor, Tensor, Tensor] | None = None,
) -> Tensor:
    r"""Return sum_k T_k(L) x W_k for the Chebyshev polynomials T_0 .. T_{K-1} of a square sparse matrix L.

    With V_k = T_k(L^T) dy the gradients are sum_k V_k W_k^T and x^T V_k, so the backward pass makes one recursion, as
    the forward pass does, and nothing but `x` and `weight` is kept in between.

    Parameters
    ----------
    indptr, indices, values
        L, shape (N, N), with its spectrum in [-1, 1].
    x
        Shape (N, C_in).
    weight
        Shape (K, C_in, C_out).
    transposed
        The arrays of L^T; None if L is symmetric.

    Returns
    -------
    Tensor
        Shape (N, C_out).
    """
    matrix = Csr(indptr, indices, values)
    other = matrix if transposed is None else Csr(*transposed)
    y: Tensor = _ChebyshevFilter.apply(x, weight, matrix, other)  # type: ignore[no-untyped-call]
    return y


def chebyshev_functions(matrix: Csr, x: Tensor, terms: int) -> Iterator[Tensor]:
    """Yield T_0(L) x .. T_{terms-1}(L) x, shape (N, C) each, without gradients."""
    before, now = x, x
    twice = matrix._replace(values=2 * matrix.values)
    for k in range(terms):
        if k == 1:
            now = matrix.times(x)
        elif k > 1:
            before, now = now, twice.times(now).sub_(before)
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
    def forward(ctx: Any, x: Tensor, weight: Tensor, matrix: Csr, transposed: Csr) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.transposed = transposed
        y = x.new_zeros(len(x), weight.shape[2])
        for function, w in zip(chebyshev_functions(matrix, x, len(weight)), weight, strict=True):
            y.addmm_(function, w)
        return y

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        x, weight = ctx.saved_tensors
        dx = torch.zeros_like(x) if ctx.needs_input_grad[0] else None
        dw = torch.empty_like(weight)
        functions = chebyshev_functions(ctx.transposed, dy.contiguous(), len(weight))
        for k, function in enumerate(functions):
            torch.mm(x.T, function, out=dw[k])
            if dx is not None:
                dx.addmm_(function, weight[k].T)
        return dx, dw, None, None
