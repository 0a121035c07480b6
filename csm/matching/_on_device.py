"""The search for nearest neighbours on a graphics card, see `csm.matching.nearest`."""

from __future__ import annotations

import torch
from torch import Tensor

from csm._types import IntArray


def search(q: Tensor, c: Tensor, block: int) -> IntArray:
    """Return the first candidate of `c` that is nearest to each row of `q`, both on one device.

    Parameters
    ----------
    q, c
        Shapes (N, Q) and (N', Q), float32 or float64.
    block
        Queries at a time.
    """
    with torch.no_grad():
        centre = c.mean(0)
        first, unsure = _search(q - centre, c - centre, block)
        if c.dtype != torch.float64 and unsure.any():
            first[unsure] = _search(q[unsure].double() - centre, c.double() - centre, block)[0]
    return first.cpu().numpy()


def _search(q: Tensor, c: Tensor, block: int) -> tuple[Tensor, Tensor]:
    """Return the first candidate within rounding of the nearest, and whether there are others."""
    half_norms = 0.5 * c.square().sum(1)
    largest = half_norms.max().sqrt()
    rounding = 4.0 * c.shape[1] ** 0.5 * torch.finfo(c.dtype).eps * largest * (q.norm(dim=1) + largest)
    first = torch.empty(len(q), dtype=torch.int64, device=q.device)
    several = torch.empty(len(q), dtype=torch.bool, device=q.device)
    for begin in range(0, len(q), block):
        here = slice(begin, begin + block)
        score = torch.addmm(half_norms, q[here], c.T, alpha=-1.0)  # half the squared distance, less |q|^2 / 2
        near = score <= (score.amin(1) + rounding[here])[:, None]
        first[here] = torch.where(near.sum(1) > 1, near.to(torch.uint8).argmax(1), score.argmin(1))
        several[here] = near.sum(1) > 1
    return first, several
