from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from csm.learning.loss import linear_cross_entropy


def problem(rows: int = 37, width: int = 5, classes: int = 23, dtype: torch.dtype = torch.float64):
    g = torch.Generator().manual_seed(0)
    x = torch.randn(rows, width, generator=g, dtype=dtype, requires_grad=True)
    weight = torch.randn(classes, width, generator=g, dtype=dtype, requires_grad=True)
    bias = torch.randn(classes, generator=g, dtype=dtype, requires_grad=True)
    target = torch.randint(classes, (rows,), generator=g)
    return x, weight, bias, target


@pytest.mark.parametrize("chunk", [1, 10, 37, 1000])
def test_loss_and_gradients_equal_pytorch_in_float64(chunk):
    x, weight, bias, target = problem()
    expected = F.cross_entropy(F.linear(x, weight, bias), target)
    wanted = torch.autograd.grad(expected, (x, weight, bias))
    loss = linear_cross_entropy(x, weight, bias, target, chunk=chunk)
    found = torch.autograd.grad(loss, (x, weight, bias))
    torch.testing.assert_close(loss, expected, rtol=1e-12, atol=0)
    for a, b in zip(found, wanted, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-10, atol=1e-14)


def test_gradcheck():
    x, weight, bias, target = problem(7, 3, 4)
    assert torch.autograd.gradcheck(lambda *a: linear_cross_entropy(*a, target, chunk=3), (x, weight, bias))


def test_the_gradient_is_scaled_by_what_comes_after_the_loss():
    x, weight, bias, target = problem()
    (once,) = torch.autograd.grad(linear_cross_entropy(x, weight, bias, target), x)
    (scaled,) = torch.autograd.grad(-2.5 * linear_cross_entropy(x, weight, bias, target), x)
    torch.testing.assert_close(scaled, -2.5 * once)


def test_bfloat16_products_stay_within_the_documented_error():
    x, weight, bias, target = problem(300, 64, 200, torch.float32)
    weight.data *= 0.1
    wanted = torch.autograd.grad(F.cross_entropy(F.linear(x, weight, bias), target), (x, weight, bias))
    loss = linear_cross_entropy(x, weight, bias, target, products="bfloat16")
    assert loss.dtype == torch.float32
    for a, b in zip(torch.autograd.grad(loss, (x, weight, bias)), wanted, strict=True):
        assert (a - b).norm() / b.norm() < 6e-3


def test_autocast_rounds_the_products_and_neither_softmax_nor_gradients():
    x, weight, bias, target = problem(300, 64, 200, torch.float32)
    weight.data *= 0.1
    wanted = linear_cross_entropy(x, weight, bias, target, products="bfloat16")
    gradients = torch.autograd.grad(wanted, (x, weight, bias))
    with torch.autocast("cpu", torch.bfloat16):
        loss = linear_cross_entropy(x, weight, bias, target)
        of_rounded = linear_cross_entropy(x.bfloat16(), weight, bias, target)
    assert loss.dtype == of_rounded.dtype == torch.float32
    torch.testing.assert_close(loss, wanted, rtol=0, atol=0)
    torch.testing.assert_close(of_rounded, wanted, rtol=1e-3, atol=0)
    for a, b in zip(torch.autograd.grad(loss, (x, weight, bias)), gradients, strict=True):
        torch.testing.assert_close(a, b, rtol=0, atol=0)


def test_extreme_logits_do_not_overflow():
    x = torch.full((2, 1), 1000.0, requires_grad=True)
    weight, bias = torch.tensor([[1.0], [-1.0]]), torch.zeros(2)
    loss = linear_cross_entropy(x, weight, bias, torch.tensor([0, 1]))
    assert torch.isfinite(loss)
    assert loss.item() == pytest.approx(1000.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": torch.zeros(3, 9)}, "shapes"),
        ({"target": torch.zeros(2, dtype=torch.long)}, "shapes"),
        ({"products": "float16"}, "bfloat16"),
    ],
)
def test_bad_input_is_named(change, message):
    x, weight, bias, target = problem(3, 5, 4)
    arguments = {"x": x, "weight": weight, "bias": bias, "target": target, "products": "float32"} | change
    with pytest.raises(ValueError, match=message):
        linear_cross_entropy(*(arguments[k] for k in ("x", "weight", "bias", "target")), products=arguments["products"])


def test_no_rows_is_an_error():
    _, weight, bias, _ = problem()
    with pytest.raises(ValueError, match="no rows"):
        linear_cross_entropy(torch.zeros(0, 5, dtype=torch.float64), weight, bias, torch.zeros(0, dtype=torch.long))


def test_without_gradients_the_loss_is_the_same():
    x, weight, bias, target = problem()
    with torch.no_grad():
        loss = linear_cross_entropy(x, weight, bias, target, chunk=10)
    torch.testing.assert_close(loss, linear_cross_entropy(x, weight, bias, target).detach())
    assert not loss.requires_grad
