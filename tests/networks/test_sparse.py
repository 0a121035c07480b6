from __future__ import annotations

import pytest
import torch

from csm.networks.csmconv import chebyshev
from csm.networks.sparse import Csr, chebyshev_filter, spmm, symmetric_matrix


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
    torch.testing.assert_close(spmm(csr(dense), x, csr(dense.T)), dense @ x)
    torch.testing.assert_close(csr(dense).times(x.T.contiguous().T), dense @ x)


def test_gradient_of_the_product():
    dense = random_matrix(9, 7)
    x = torch.randn(7, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v: spmm(csr(dense), v, csr(dense.T)), (x,))


def test_gradient_that_is_spread_out_in_memory():
    dense = random_matrix(9, 7)
    x = torch.randn(7, 3, dtype=torch.float64, requires_grad=True)
    spmm(csr(dense), x, csr(dense.T)).sum().backward()
    torch.testing.assert_close(x.grad, dense.sum(0)[:, None].expand(7, 3))


def symmetric(seed: int) -> torch.Tensor:
    half = random_matrix(8, 8, seed)
    return scaled(half + half.T)


@pytest.mark.parametrize("terms", [1, 2, 3, 7])
@pytest.mark.parametrize("count", [1, 3])
def test_filter_is_the_sum_of_polynomials_of_the_matrices(terms, count):
    matrices = [symmetric(seed) for seed in range(count)]
    x, weight = torch.randn(8, 3, dtype=torch.float64), torch.randn(terms, count, 3, 2, dtype=torch.float64)
    expected = torch.zeros(8, 2, dtype=torch.float64)
    for j, matrix in enumerate(matrices):
        evals, evecs = torch.linalg.eigh(matrix)
        for k, t in enumerate(chebyshev(evals, terms)):
            expected += evecs @ t.diag() @ evecs.T @ x @ weight[k, j]
    y = chebyshev_filter(x, weight, [symmetric_matrix(*csr(matrix)) for matrix in matrices])
    torch.testing.assert_close(y, expected)


@pytest.mark.parametrize("terms", [1, 2, 5])
def test_gradients_of_the_filter(terms):
    matrices = [symmetric_matrix(*csr(symmetric(seed))) for seed in (0, 1)]
    x = torch.randn(8, 3, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(terms, 2, 3, 2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v, w: chebyshev_filter(v, w, matrices), (x, weight))


def test_a_second_derivative_is_refused():
    dense = random_matrix(6, 6)
    x = torch.randn(6, 2, dtype=torch.float64, requires_grad=True)
    (grad,) = torch.autograd.grad(spmm(csr(dense), x, csr(dense.T)).square().sum(), x, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        grad.sum().backward()
