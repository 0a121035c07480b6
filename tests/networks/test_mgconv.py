from __future__ import annotations

from functools import partial

import pytest
import torch
from torch import Tensor
from torch.func import functional_call

from csm.networks import Surface, mgconv
from csm.networks.mgconv import MGConv, WaveletOperators, unit_range
from tests.operators.stencils.test_wavelets import SMALL, published
from tests.shapes import blob
from tests.surfaces import surface_of

MESH = blob(2)


def surface(**parameters) -> Surface:
    return surface_of(MESH, 2, {"wavelets": {**SMALL, "patch": 40, **parameters}})


def operators(
    tolerance: float = 0.0, dtype: torch.dtype = torch.float64, patch: int = 40, **options
) -> WaveletOperators:
    return WaveletOperators(surface(tolerance=tolerance, patch=patch).stencil("wavelets"), dtype, **options)


@pytest.fixture(scope="module")
def dense() -> Tensor:
    """The transposed operators G_s^T, shape (S, N, N)."""
    return torch.as_tensor(published(MESH, **SMALL)).mT


def functions(channels: int = 3) -> Tensor:
    return torch.rand(MESH.n_vertices, channels, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def test_the_layer_is_the_dense_formula(dense):
    torch.manual_seed(0)
    conv, x = MGConv(3, 5, wavelets=4).double(), 7 * functions() - 3
    scaled = (x - x.min(0).values) / (x.max(0).values - x.min(0).values)
    terms = [scaled, *(g @ scaled for g in dense)]
    expected = sum(term @ weight for term, weight in zip(terms, conv.weight, strict=True))
    torch.testing.assert_close(conv(x, operators()), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("tolerance", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("products", ["float32", "bfloat16"])
def test_weights_sum_to_one(tolerance, products):
    ones = torch.ones(MESH.n_vertices, 2, dtype=torch.float64)
    averages = operators(tolerance, products=products).averages(ones)
    torch.testing.assert_close(averages, ones[:, None].expand(-1, 4, -1), rtol=4e-3, atol=0)


@pytest.mark.parametrize("tolerance", [0.01, 0.1])
def test_the_mean_stands_for_what_is_dropped(dense, tolerance):
    """The error stays within the tolerance, and far within it as the mean is a fair guess."""
    x = functions()
    error = (operators(tolerance, patch=10).averages(x) - torch.einsum("snm,mc->nsc", dense, x)).abs().max()
    assert 0 < error < 0.5 * tolerance


def test_gradients_in_float64():
    applied, conv = operators(0.01), MGConv(2, 2, wavelets=4).double()
    x = functions(2).requires_grad_()
    assert torch.autograd.gradcheck(applied.averages, (x,), fast_mode=True)
    run = partial(functional_call, conv)
    assert torch.autograd.gradcheck(lambda w, v: run({"weight": w}, (v, applied)), (conv.weight, x), fast_mode=True)


def test_making_blocks_again_gives_what_holding_them_gives(monkeypatch):
    x = functions().requires_grad_()
    upstream = torch.randn(MESH.n_vertices, 4, 3, dtype=torch.float64)
    held = operators(0.01)
    expected = held.averages(x), torch.autograd.grad(held.averages(x), x, upstream)[0]
    monkeypatch.setattr(mgconv, "HELD_BYTES", 0)
    made = operators(0.01)
    assert next(iter(made)) is not next(iter(made))
    assert next(iter(held)) is next(iter(held))
    torch.testing.assert_close((made.averages(x), torch.autograd.grad(made.averages(x), x, upstream)[0]), expected)


def test_whole_operators_drop_nothing_whatever_the_stencil_does(dense, monkeypatch):
    """They are what a graphics card multiplies with; blocks of rows that do not divide the vertices are no matter."""
    monkeypatch.setattr(mgconv, "WHOLE_ROWS", 50)
    x = functions().requires_grad_()
    assert MESH.n_vertices > 50
    assert MESH.n_vertices % 50
    averages = operators(0.3, whole=True).averages(x)
    torch.testing.assert_close(averages, torch.einsum("snm,mc->nsc", dense, x), rtol=1e-5, atol=1e-5)
    upstream = torch.randn_like(averages)
    expected = torch.autograd.grad(operators(0.0).averages(x), x, upstream)
    torch.testing.assert_close(torch.autograd.grad(averages, x, upstream), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a graphics card")
def test_a_graphics_card_multiplies_whole_operators(dense):
    stencil = {name: tensor.cuda() for name, tensor in surface(tolerance=0.3).stencil("wavelets").items()}
    averages = WaveletOperators(stencil, torch.float64).averages(functions().cuda())
    torch.testing.assert_close(averages.cpu(), torch.einsum("snm,mc->nsc", dense, functions()), rtol=1e-5, atol=1e-5)


def test_blocks_are_as_large_as_they_say():
    blocks = operators(0.01, torch.float32)
    assert sum(p.nbytes for patch in blocks for p in patch.powers) == blocks.n_bytes


def test_bfloat16_is_close():
    x = functions()
    exact, rounded = (operators(products=p).averages(x) for p in ("float32", "bfloat16"))  # type: ignore[arg-type]
    assert 0 < (exact - rounded).norm() / exact.norm() < 4e-3


def test_columns_are_brought_to_the_unit_range_and_constants_to_zero():
    x = torch.tensor([[2.0, -1.0], [2.0, 3.0], [2.0, 1.0]], requires_grad=True)
    scaled = unit_range(x)
    torch.testing.assert_close(scaled, torch.tensor([[0.0, 0.0], [0.0, 1.0], [0.0, 0.5]]))
    scaled.sum().backward()
    assert torch.isfinite(x.grad).all()


def test_initial_weights_are_within_glorots_bound():
    weight = MGConv(96, 128).weight
    assert weight.shape == (17, 96, 128)
    assert 0.99 * (6 / 224) ** 0.5 < weight.abs().max() <= (6 / 224) ** 0.5
