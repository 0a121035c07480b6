"""The scale of a network's input, learned from its training shapes."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn


class Standardisation(nn.Module):
    """Columns of the input with mean 0 and deviation 1 over the training shapes.

    Parameters
    ----------
    columns
        Width P of the input.
    limit
        Deviations from the mean at which a value is cut: a sliver's must not drown the others.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, columns: int, limit: float = 10.0) -> None:
        super().__init__()
        self.limit = limit
        self.register_buffer("mean", torch.zeros(columns))
        self.register_buffer("deviation", torch.ones(columns))

    def learn(self, shapes: Iterable[Tensor]) -> None:
        """Take means and deviations over shapes, each of shape (N, P), which count alike whatever their N."""
        moments = [torch.stack([x.double().mean(0), x.double().square().mean(0)]) for x in shapes]
        mean, square = torch.stack(moments).mean(0)
        deviation = (square - mean.square()).clamp(min=0).sqrt()
        self.mean.copy_(mean)
        self.deviation.copy_(torch.where(deviation > 1e-7 * mean.abs(), deviation, 1.0))  # a constant column stays 0

    def forward(self, x: Tensor) -> Tensor:
        """Return the input, shape (N, P), standardised and cut."""
        return ((x - self.mean) / self.deviation).clamp(-self.limit, self.limit)
