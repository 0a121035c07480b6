from __future__ import annotations

import pytest
import torch

from csm.errors import ConfigError
from csm.learning.variation import Variation


def test_columns_are_scaled_and_shifted_alike_at_all_vertices_and_anew_each_time():
    torch.manual_seed(0)
    x, change = torch.randn(40, 6), Variation(0.3)
    first, second = change(x), change(x)
    assert not torch.allclose(first, second)
    for column in range(6):
        line = torch.stack([x[:, column], torch.ones(40)], 1)
        scale, shift = torch.linalg.lstsq(line, first[:, column]).solution
        torch.testing.assert_close(scale * x[:, column] + shift, first[:, column], atol=1e-5, rtol=1e-5)
        assert scale > 0


def test_the_spread_is_that_of_the_draws():
    torch.manual_seed(0)
    change = Variation(0.5)
    ends = torch.tensor([[0.0], [1.0]]).expand(2, 20000)
    low, high = change(ends)
    assert low.std().item() == pytest.approx(0.5, rel=0.03)
    assert (high - low).log().std().item() == pytest.approx(0.5, rel=0.03)


def test_nothing_changes_in_evaluation_or_without_a_spread():
    x = torch.randn(5, 3)
    assert Variation(0.3).eval()(x) is x
    assert Variation(0.0)(x) is x


@pytest.mark.parametrize("spread", [-0.1, float("nan")])
def test_a_negative_spread_is_an_error(spread):
    with pytest.raises(ConfigError, match=r"learning\.vary=.*wanted 0 for none"):
        Variation(spread)
