"""How far functional maps are from those of isometries."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Judged(NamedTuple):
    """Two figures for each of B functional maps, shape (B,); both are 0 for an isometry.

    `stretch` is |C^T C - 1| / sqrt(K): areas are not kept.  `commutation` is |C Lambda_t - Lambda_s C| over the
    geometric mean of |Lambda_s| and |Lambda_t|: lengths are not kept.
    """

    stretch: Tensor
    commutation: Tensor


def judged(matrices: Tensor, source: Tensor, target: Tensor) -> Judged:
    """Judge functional maps (B, K, K) between shapes with K eigenvalues each, `source` and `target`.

    Examples
    --------
    >>> evals = torch.tensor([0.0, 1.0, 2.0])
    >>> judged(torch.eye(3)[None], evals, evals)
    Judged(stretch=tensor([0.]), commutation=tensor([0.]))
    """
    k = matrices.shape[-1]
    unit = torch.eye(k, dtype=matrices.dtype, device=matrices.device)
    stretch = (matrices.transpose(1, 2) @ matrices - unit).flatten(1).norm(dim=1) / k**0.5
    gaps = matrices * target - source[:, None] * matrices
    size = torch.clamp((source.norm() * target.norm()).sqrt(), min=torch.finfo(matrices.dtype).tiny)
    return Judged(stretch, gaps.flatten(1).norm(dim=1) / size)
