from __future__ import annotations

import torch

from csm.networks import Basis, Identity, Surface, build

NOWHERE = Surface(Basis(torch.zeros(0), torch.zeros(7, 0), torch.ones(7)))


def test_the_descriptor_is_the_input_and_the_classifier_a_linear_probe():
    net = build("identity", 3, 5).eval()
    assert isinstance(net, Identity)
    x = torch.randn(7, 3)
    assert net.describe(x, NOWHERE) is x
    torch.testing.assert_close(net(x, NOWHERE), x @ net.classifier.weight.T + net.classifier.bias)
