"""Products with constant sparse matrices, and filters that are polynomials of them.

The matrices are not learned, so no gradient with respect to them is computed.  The gradient with respect to the factor
of a matrix is a product with the transposed matrix.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
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

        An embedding bag is a sum of weighted rows as well, and its kernel is the fastest for this that PyTorch has on a
        processor: with 64 channels it takes half the time of a sparse tensor.
        """
        weights = self.values.to(x.dtype)
        return F.embedding_bag(
            self.indices, x.detach(), self.indptr, mode="sum", per_sample_weights=weights, include_last_offset=True
        )


def widened(x: Tensor) -> Tensor:
    """Return functions of half the precision, which autocast makes, as float32, and others as they are."""
    return x.float() if x.dtype in (torch.bfloat16, torch.float16) else x


def without_autocast(x: Tensor) -> AbstractContextManager[object]:
    """Return a block in which products on the device of `x` keep the precision of their factors."""
    known = torch.amp.is_autocast_available(x.device.type)
    return torch.autocast(x.device.type, enabled=False) if known else nullcontext()


def spmm(matrix: Csr, x: Tensor, transposed: Csr) -> Tensor:
    """Multiply a sparse matrix, shape (N, M), with `x`, shape (M, C); the gradient goes to `x` alone.

    `transposed` is the same matrix with rows and columns exchanged, shape (M, N); the backward pass multiplies with it.
    """
    with without_autocast(x):
        y: Tensor = _Product.apply(widened(x), matrix, transposed)  # type: ignore[no-untyped-call]
    return y


def symmetric_matrix(indptr: Tensor, indices: Tensor, values: Tensor) -> Tensor:
    """Return a symmetric matrix in the form that `chebyshev_filter` takes: a sparse tensor, (N, N), of int32 indices.

    For sparse tensors the recursion of the Chebyshev polynomials, which adds a product to another function, is a single
    call of a kernel.  With 64 channels this takes half the time of `Csr.times`.
    """
    n = len(indptr) - 1
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sparse CSR tensor support is in beta", UserWarning)
        return torch.sparse_csr_tensor(indptr.int(), indices.int(), values, (n, n), check_invariants=False)


def chebyshev_filter(x: Tensor, weight: Tensor, matrices: Sequence[Tensor]) -> Tensor:
    r"""Return the sum over j and k of T_k(M_j) x W_kj, with the Chebyshev polynomials T_0 .. T_{K-1}.

    With V_kj = T_k(M_j) dy, the gradient of x is the sum of V_kj W_kj^T and that of W_kj is x^T V_kj.  The backward
    pass therefore repeats the recursion of the forward pass, and only `x` and `weight` are kept in between.  All terms
    of one matrix are computed before those of the next, so that the matrix stays in the processor's cache.

    Parameters
    ----------
    x
        Functions, shape (N, C_in).
    weight
        Shape (K, J, C_in, C_out).
    matrices
        The J symmetric matrices M_j, shape (N, N), made by `symmetric_matrix`, with eigenvalues in [-1, 1].

    Returns
    -------
    Tensor
        Shape (N, C_out).
    """
    with without_autocast(x):
        y: Tensor = _ChebyshevFilter.apply(widened(x), weight, matrices)  # type: ignore[no-untyped-call]
    return y


def chebyshev_functions(matrix: Tensor, x: Tensor, terms: int) -> Iterator[Tensor]:
    """Yield T_1(M) x .. T_{terms-1}(M) x, shape (N, C) each; the next function but one overwrites each of them."""
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
    """`spmm`, whose backward pass multiplies with the transposed matrix."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, matrix: Csr, transposed: Csr) -> Tensor:
        ctx.transposed = transposed
        return matrix.times(x)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        return ctx.transposed.times(dy.contiguous()), None, None


class _ChebyshevFilter(torch.autograd.Function):
    """`chebyshev_filter` with the gradients that its docstring derives."""

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
