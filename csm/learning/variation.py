"""What training shapes are changed by, anew in every step, so that a network does not learn what only they have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from csm.descriptors.presets import from_parameters
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
        if isinstance(spread, bool) or not isinstance(spread, int | float) or not 0 <= spread < 10:
            raise ConfigError(f"learning.vary={spread}; wanted 0 for none, or a spread up to 10, such as 0.3")
        self.spread = spread

    def forward(self, x: Tensor) -> Tensor:
        """Return the input, shape (N, P), varied in training, and as it is otherwise."""
        if not self.training or not self.spread:
            return x
        scale, shift = self.spread * torch.randn(2, x.shape[1], device=x.device, dtype=x.dtype)
        varied: Tensor = x * scale.exp() + shift
        return varied


def image_columns(mirror: float, descriptor: Mapping[str, Any]) -> Tensor:
    """Return which column of the input is which of a mirror image, shape (P,); of length 0 if no step sees one.

    Parameters
    ----------
    mirror
        Share of the steps that see one.
    descriptor
        Name and parameters of the input.

    Raises
    ------
    ConfigError
        If the share is none, or it is not known how the descriptor's columns change.

    Examples
    --------
    >>> from csm.descriptors import ACD
    >>> from csm.descriptors.base import record
    >>> image_columns(0.5, record(ACD(angles=3, k=5, cuts=1, order=1))).tolist()
    [0, 1, 4, 5, 2, 3]
    """
    if isinstance(mirror, bool) or not isinstance(mirror, int | float) or not 0 <= mirror < 1:
        raise ConfigError(f"learning.mirror={mirror}; wanted a share of the steps, from 0 to below 1, such as 0.5")
    if not mirror:
        return torch.zeros(0, dtype=torch.int64)
    try:
        return torch.as_tensor(from_parameters(**descriptor).mirrored_columns(), device="cpu")
    except ConfigError as error:
        raise ConfigError(f"learning.mirror={mirror}: {error}; set learning.mirror=0") from error
