"""Rows of numbers, one per vertex, in the forms that they come in: arrays, tensors, and what descriptors return."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from torch import Tensor

    from csm.descriptors.base import Features

Rows: TypeAlias = "NDArray[Any] | Tensor | Features"


def is_tensor(rows: object) -> TypeGuard[Tensor]:
    """Tell whether rows are a tensor, without importing PyTorch, which takes longer than many a comparison of rows.

    Examples
    --------
    >>> is_tensor(np.zeros((3, 2)))
    False
    """
    return hasattr(rows, "detach")


def as_array(rows: Rows) -> NDArray[Any]:
    """Return rows as an array of float32 or float64 in the memory of the processor; other numbers become float32.

    Examples
    --------
    >>> as_array(np.array([[1], [2]])).dtype
    dtype('float32')
    """
    if is_tensor(rows):
        plain = rows.detach().cpu()
        rows = plain.numpy() if str(plain.dtype) in ("torch.float32", "torch.float64") else plain.float().numpy()
    array = np.asarray(rows)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float32)
