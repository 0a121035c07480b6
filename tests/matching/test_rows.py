"""Rows of numbers from arrays, tensors and descriptors."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.descriptors.constant import Constant
from csm.matching.rows import as_array, is_tensor
from tests.shapes import sphere

NUMBERS = [[1.5, -2.0], [0.25, 3.0]]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_numbers_of_a_tensor_are_its_own(dtype: torch.dtype) -> None:
    tensor = torch.tensor(NUMBERS, dtype=dtype, requires_grad=True)
    array = as_array(tensor)
    assert array.tolist() == NUMBERS
    assert torch.from_numpy(array).dtype == dtype
    assert np.shares_memory(array, tensor.detach().numpy())


@pytest.mark.parametrize("rows", [torch.tensor(NUMBERS, dtype=torch.bfloat16), np.array(NUMBERS, dtype=np.float16)])
def test_other_kinds_of_numbers_become_float32(rows: torch.Tensor | np.ndarray) -> None:
    assert as_array(rows).dtype == np.float32
    assert as_array(rows).tolist() == NUMBERS


def test_what_a_descriptor_returns_is_an_array() -> None:
    features = Constant()(sphere(1))
    assert not is_tensor(features)
    np.testing.assert_array_equal(as_array(features), np.asarray(features))
    assert is_tensor(torch.zeros(1))
