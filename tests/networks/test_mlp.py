from __future__ import annotations

import pytest
import torch

from csm.networks import CSMCNN, MLP, Basis, Surface, build, settings

NOWHERE = Surface(Basis(torch.zeros(0), torch.zeros(7, 0), torch.ones(7)))


def count(net: torch.nn.Module) -> int:
    return sum(p.numel() for p in net.parameters())


def test_the_default_is_csmcnn_without_its_convolutions():
    convolutions = count(CSMCNN(48, 6890).convs) + 2 * (64 + 64 + 128)  # and their batch normalisation
    narrower = 256 * 64  # MLP256 has 64 inputs in place of 128
    assert count(MLP(48, 6890)) == count(CSMCNN(48, 6890)) - convolutions - narrower


def test_count_of_the_network_of_add():
    batch_norm = 4 * 2 * 256
    assert count(MLP(256, 6890, widths=(256, 256, 256, 256))) == 4 * (256 * 256 + 256) + batch_norm + 1_770_730


def test_the_network_of_osd_is_that_of_add_on_narrower_rows():
    osd, add = (build(in_channels=n, n_classes=6890, **settings(name)) for n, name in ((150, "osd"), (256, "add_mlp")))
    assert count(osd) == count(add) - (256 - 150) * 256 == 2_008_810


def test_against_the_layers_one_by_one():
    torch.manual_seed(0)
    net = MLP(3, 5, widths=(4, 6), normalisation="none", activation="elu").double().eval()
    x = torch.randn(7, 3, dtype=torch.float64)
    first, second = (layer for layer in net.layers if isinstance(layer, torch.nn.Linear))
    expected = torch.nn.functional.elu(second(torch.nn.functional.elu(first(x))))
    torch.testing.assert_close(net.describe(x, NOWHERE), expected)
    torch.testing.assert_close(net(x, NOWHERE), expected @ net.classifier.weight.T + net.classifier.bias)


def test_a_vertex_sees_itself_only():
    net = MLP(3, 5).eval()
    x = torch.randn(7, 3)
    changed = x.clone()
    changed[2] += 1
    differs = (net.describe(changed, NOWHERE) != net.describe(x, NOWHERE)).any(dim=1)
    assert differs.tolist() == [i == 2 for i in range(7)]


@pytest.mark.parametrize("normalisation", ["batch", "instance", "none"])
def test_every_parameter_learns(normalisation):
    torch.manual_seed(0)
    net = MLP(3, 5, normalisation=normalisation)
    net(torch.randn(7, 3), NOWHERE).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in net.parameters())


def test_unknown_names_are_refused():
    with pytest.raises(ValueError, match="relu"):
        MLP(3, 4, activation="sine")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="instance"):
        MLP(3, 4, normalisation="layer")  # type: ignore[arg-type]
