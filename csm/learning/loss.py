"""Cross-entropy over many classes without the matrix of logits."""

from __future__ import annotations

from typing import Any, Literal

import torch
from torch import Tensor

from csm.networks.sparse import without_autocast

Products = Literal["float32", "bfloat16"]


def linear_cross_entropy(
    x: Tensor,
    weight: Tensor,
    bias: Tensor,
    target: Tensor,
    *,
    chunk: int = 512,
    products: Products = "float32",
) -> Tensor:
    r"""Mean cross-entropy of the linear classifier ``x @ weight.T + bias``, computed in chunks of rows.

    Equal to ``F.cross_entropy(F.linear(x, weight, bias), target)``, but the logits exist for `chunk` rows at a time,
    and the gradients with respect to `x`, `weight` and `bias` are made in the same pass:

    .. math::
        \partial L / \partial z = (\mathrm{softmax}(z) - \mathrm{onehot}(t)) / R, \qquad z = x W^\top + b

    so memory grows with ``chunk * C`` instead of ``R * C``, and the products are not made twice.

    Parameters
    ----------
    x
        Shape (R, D): one row per classified vertex.
    weight, bias
        Shapes (C, D) and (C,): the classifier over C classes.
    target
        Shape (R,), int64: the class of each row.
    chunk
        Rows at a time.
    products
        "float32" keeps the precision of `weight` (float32, or float64 when the weights are float64);
        "bfloat16" rounds the factors and results of the three matrix products to bfloat16, with the softmax in
        float32: several times faster on processors with bfloat16 units, at a relative gradient error of about 3e-3.
        Within PyTorch's autocast to bfloat16 (``trainer.precision=bf16-mixed``) the products are bfloat16 in any case.

    Returns
    -------
    Tensor
        The mean loss, a scalar in the precision of `weight`.

    Raises
    ------
    ValueError
        If the shapes do not fit, there are no rows, or `products` is unknown.
    """
    if x.ndim != 2 or x.shape[1] != weight.shape[1] or bias.shape != weight.shape[:1] or target.shape != x.shape[:1]:
        shapes = ", ".join(str(tuple(t.shape)) for t in (x, weight, bias, target))
        raise ValueError(f"x, weight, bias, target have shapes {shapes}; wanted (R, D), (C, D), (C,), (R,)")
    if len(x) == 0:
        raise ValueError("there are no rows to classify")
    if products not in ("float32", "bfloat16"):
        raise ValueError(f'products is "float32" or "bfloat16", got {products!r}')
    low_precision = products == "bfloat16" or _is_autocast_to_bfloat16(x.device.type)
    with without_autocast(x):  # it would also round the softmax
        loss: Tensor = _LinearCrossEntropy.apply(  # type: ignore[no-untyped-call]
            x.to(weight.dtype), weight, bias, target, chunk, low_precision, torch.is_grad_enabled()
        )
    return loss


def _is_autocast_to_bfloat16(device: str) -> bool:
    if not torch.amp.is_autocast_available(device):
        return False
    return torch.is_autocast_enabled(device) and torch.get_autocast_dtype(device) == torch.bfloat16


class _LinearCrossEntropy(torch.autograd.Function):
    """Loss and gradients in one pass over the rows; the backward pass only scales the gradients."""

    @staticmethod
    def forward(
        ctx: Any,
        x: Tensor,
        weight: Tensor,
        bias: Tensor,
        target: Tensor,
        chunk: int,
        low_precision: bool,
        learning: bool,
    ) -> Tensor:
        dtype = torch.bfloat16 if low_precision else x.dtype
        w, b, features = weight.to(dtype), bias.to(dtype), x.to(dtype)
        grad_x, grad_w, grad_b = torch.empty_like(x), torch.zeros_like(weight), torch.zeros_like(bias)
        total = x.new_zeros(())
        for begin in range(0, len(x), chunk):
            rows = slice(begin, begin + chunk)
            t = target[rows, None]
            log_p = torch.log_softmax(torch.addmm(b, features[rows], w.T), 1, dtype=x.dtype)
            total -= log_p.gather(1, t).sum()
            if not learning:
                continue
            p = log_p.exp_()
            p.scatter_add_(1, t, p.new_full(t.shape, -1.0))
            grad_b += p.sum(0)
            p = p.to(dtype)
            grad_x[rows] = (p @ w).to(x.dtype)
            grad_w += (p.T @ features[rows]).to(x.dtype)
        ctx.save_for_backward(grad_x, grad_w, grad_b)
        ctx.rows = len(x)
        return total / len(x)

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor | None, ...]:
        scale = grad_outputs[0] / ctx.rows
        grad_x, grad_w, grad_b = ctx.saved_tensors
        return grad_x * scale, grad_w * scale, grad_b * scale, None, None, None, None
