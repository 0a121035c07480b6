from __future__ import annotations

import pytest
import torch

from csm.networks.csmconv import chebyshev
from csm.networks.sparse import Csr, chebyshev_filter, chebyshev_functions, spmm


def csr(dense: torch.Tensor) -> Csr:
    rows, columns = dense.nonzero(as_tuple=True)
    counts = torch.bincount(rows, minlength=len(dense))
    return Csr(torch.cat([counts.new_zeros(1), counts.cumsum(0)]), columns, dense[rows, columns])


def random_matrix(n: int, m: int, seed: int = 0) -> torch.Tensor:
    """A matrix with a third of its entries, an empty row and an empty column."""
    torch.manual_seed(seed)
    dense = torch.randn(n, m, dtype=torch.float64) * (torch.rand(n, m) < 0.3)
    dense[1], dense[:, 2] = 0, 0
    return dense


def scaled(dense: torch.Tensor) -> torch.Tensor:
    return dense / torch.linalg.matrix_norm(dense, 2)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_product_is_that_of_the_dense_matrix(dtype):
    dense = random_matrix(9, 7).to(dtype)
    x = torch.randn(7, 5, dtype=dtype)
    torch.testing.assert_close(spmm(*csr(dense), x, csr(dense.T)), dense @ x)
    torch.testing.assert_close(csr(dense).times(x.T.contiguous().T), dense @ x)


def test_gradient_of_the_product():
    dense = random_matrix(9, 7)
    x = torch.randn(7, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v: spmm(*csr(dense), v, csr(dense.T)), (x,))
    symmetric = dense.T @ dense
    assert torch.autograd.gradcheck(lambda v: spmm(*csr(symmetric), v), (x,))


def test_gradient_that_is_spread_out_in_memory():
    dense = random_matrix(9, 7)
    x = torch.randn(7, 3, dtype=torch.float64, requires_grad=True)
    spmm(*csr(dense), x, csr(dense.T)).sum().backward()
    torch.testing.assert_close(x.grad, dense.sum(0)[:, None].expand(7, 3))


@pytest.mark.parametrize("terms", [1, 2, 3, 7])
def test_functions_are_the_polynomials_of_the_matrix(terms):
    half = random_matrix(8, 8)
    evals, evecs = torch.linalg.eigh(scaled(half + half.T))
    x = torch.randn(8, 3, dtype=torch.float64)
    matrix = evecs @ evals.diag() @ evecs.T
    expected = [evecs @ t.diag() @ evecs.T @ x for t in chebyshev(evals, terms)]
    torch.testing.assert_close(list(chebyshev_functions(csr(matrix), x, terms)), expected)


@pytest.mark.parametrize("terms", [1, 2, 5])
@pytest.mark.parametrize("symmetric", [True, False])
def test_filter_and_its_gradients(terms, symmetric):
    half = random_matrix(8, 8)
    dense = scaled(half + half.T if symmetric else half)
    transposed = None if symmetric else csr(dense.T)
    x = torch.randn(8, 3, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(terms, 3, 2, dtype=torch.float64, requires_grad=True)
    y = chebyshev_filter(*csr(dense), x, weight, transposed)
    expected = sum(t @ w for t, w in zip(chebyshev_functions(csr(dense), x.detach(), terms), weight, strict=True))
    torch.testing.assert_close(y, expected)
    assert torch.autograd.gradcheck(lambda v, w: chebyshev_filter(*csr(dense), v, w, transposed), (x, weight))


def test_a_second_derivative_is_refused():
    dense = random_matrix(6, 6)
    x = torch.randn(6, 2, dtype=torch.float64, requires_grad=True)
    (grad,) = torch.autograd.grad(spmm(*csr(dense), x, csr(dense.T)).square().sum(), x, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        grad.sum().backward()
