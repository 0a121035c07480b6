"""What training shapes are changed by, anew in every step, so that a network does not learn what only they have."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from csm.errors import ConfigError


class Variation(nn.Module):
    """Columns of the input scaled and shifted at random: what differs from body to body, and not from place to place.

    Every column x of a standardised input becomes ``exp(s a) x + s b``, with normally distributed a and b that are
    drawn anew in every step and are the same at all vertices.

    Parameters
    ----------
    spread
        s, from 0 on.

    Raises
    ------
    ConfigError
        If `spread` is negative.

    Examples
    --------
    >>> Variation(0.0)(torch.ones(2, 3)).tolist()
    [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]
    """

    def __init__(self, spread: float) -> None:
        super().__init__()
        if not spread >= 0:
            raise ConfigError(f"learning.vary={spread}; wanted 0 for none, or a spread above, such as 0.3")
        self.spread = spread

    def forward(self, x: Tensor) -> Tensor:
        """Return the input, shape (N, P), varied in training, and as it is otherwise."""
        if not self.training or not self.spread:
            return x
        scale, shift = self.spread * torch.randn(2, x.shape[1], device=x.device, dtype=x.dtype)
        varied: Tensor = x * scale.exp() + shift
        return varied
