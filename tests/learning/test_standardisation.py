from __future__ import annotations

import torch

from csm.learning.standardisation import Standardisation


def test_standardised_inputs_have_mean_zero_and_deviation_one_over_the_shapes_whatever_their_sizes():
    shapes = [torch.randn(n, 3) * torch.tensor([1.0, 50.0, 0.0]) + torch.tensor([5.0, 0.0, 7.0]) for n in (40, 4000)]
    inputs = Standardisation(3)
    inputs.learn(shapes)
    moments = torch.stack([inputs(x).mean(0) for x in shapes]).mean(0)
    spread = torch.stack([inputs(x).square().mean(0) for x in shapes]).mean(0)
    torch.testing.assert_close(moments, torch.zeros(3), atol=1e-3, rtol=0)
    torch.testing.assert_close(spread, torch.tensor([1.0, 1.0, 0.0]), atol=1e-3, rtol=0)
    assert inputs(torch.full((1, 3), 1e9)).max() == 10
