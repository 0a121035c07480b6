from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor, nn

from csm.networks import NETWORKS, Basis, ConvolutionalNetwork, CorrespondenceNetwork, Surface

SURFACE = Surface(Basis(torch.zeros(0), torch.zeros(7, 0), torch.rand(7) + 1))


class Halves(CorrespondenceNetwork):
    """The least that a network has to say of itself."""

    def __init__(self, in_channels: int, n_classes: int) -> None:
        super().__init__()
        self.add_classifier(in_channels, n_classes, 0.5)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        return x / 2


class Weighing(nn.Module):
    def __init__(self, factor: float) -> None:
        super().__init__()
        self.factor = factor

    def forward(self, x: Tensor, mass: Tensor, shift: float) -> Tensor:
        return self.factor * mass[:, None] * x + shift


class Weighings(ConvolutionalNetwork):
    """Two convolutions that can be written down, without the hooks that have a default."""

    def __init__(self) -> None:
        super().__init__()
        self.convs = nn.ModuleList(Weighing(factor) for factor in (1.0, -2.0))
        self.embed = nn.Linear(3, 4)
        self.add_classifier(4, 5, 0.0)

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        return surface.basis.mass.to(dtype), 0.25


class Hooked(Weighings):
    def lifted(self, x: Tensor, surface: Surface) -> Tensor:
        return x + 1

    def activated(self, x: Tensor, layer: int, surface: Surface) -> Tensor:
        return x + 10 ** (layer + 1)


def test_a_network_is_what_it_describes_then_dropout_then_the_classifier():
    net, x = Halves(3, 5), torch.randn(7, 3)
    torch.manual_seed(0)
    logits = net(x, SURFACE)
    torch.manual_seed(0)
    dropped = nn.functional.dropout(x / 2, 0.5)
    torch.testing.assert_close(logits, dropped @ net.classifier.weight.T + net.classifier.bias)
    torch.testing.assert_close(net.eval()(x, SURFACE), net.classifier(x / 2))


def test_by_default_a_network_needs_nothing_of_a_shape_and_has_no_filters():
    net = Halves(3, 5)
    assert net.n_eigenpairs == 0
    assert net.stencils() == {}
    assert net.filters(torch.arange(4.0)) == {}


def test_a_network_that_describes_nothing_cannot_be_made():
    for incomplete in (CorrespondenceNetwork, ConvolutionalNetwork):
        with pytest.raises(TypeError, match="abstract"):
            incomplete()


def test_convolutions_follow_each_other_with_elu_and_the_linear_layer_ends_them():
    net, x, mass, elu = Weighings(), torch.randn(7, 3), SURFACE.basis.mass[:, None], nn.functional.elu
    first = elu(mass * x + 0.25)
    second = elu(-2 * mass * first + 0.25)
    torch.testing.assert_close(net.describe(x, SURFACE), elu(net.embed(second)))


def test_hooks_are_told_the_number_of_the_layer():
    net, x, mass = Hooked(), torch.randn(7, 3), SURFACE.basis.mass[:, None]
    first = mass * (x + 1) + 0.25 + 10
    second = -2 * mass * first + 0.25 + 100
    torch.testing.assert_close(net.describe(x, SURFACE), net.embed(second) + 1000)


def test_operators_have_the_precision_of_the_functions():
    net, x = Weighings().double(), torch.randn(7, 3, dtype=torch.float64)
    assert net.describe(x, SURFACE).dtype == torch.float64


@pytest.mark.parametrize("name", NETWORKS)
def test_every_network_ends_in_a_classifier_and_lists_its_parameters_last(name):
    net = NETWORKS[name](4, 30)
    assert isinstance(net, CorrespondenceNetwork)
    assert isinstance(net.dropout, nn.Dropout)
    assert net.classifier.out_features == 30
    assert list(net.state_dict())[-2:] == ["classifier.weight", "classifier.bias"]


ASKED = {"csmcnn": {"ks": 9}, "diffusionnet": {"ks": 11}}


@pytest.mark.parametrize("name", NETWORKS)
def test_number_of_eigenpairs(name):
    expected = ASKED.get(name, {}).get("ks", 0)
    assert NETWORKS[name](4, 30, **ASKED.get(name, {})).n_eigenpairs == expected


@pytest.mark.parametrize("name", ASKED)
def test_a_network_uses_no_eigenpair_beyond_those_that_it_states(name):
    torch.manual_seed(0)
    mass, evecs = torch.rand(20) + 0.1, torch.randn(20, 16)
    pattern = {"indptr": torch.arange(21), "indices": torch.arange(20), "mirror": torch.arange(20)}
    gradients = {"gradients": {**pattern, "values": torch.randn(2, 20)}}
    net, x = NETWORKS[name](4, 30, **ASKED[name]).eval(), torch.randn(20, 4)

    def described(first: int, last: Tensor) -> Tensor:
        changed = torch.cat([evecs[:, :first], last[:, first:]], dim=1)
        return net.describe(x, Surface(Basis(torch.arange(16.0), changed, mass), gradients))

    k, other = net.n_eigenpairs, torch.randn(20, 16)
    for block in getattr(net, "blocks", ()):
        block.diffusion.time.data.fill_(0.01)
    assert torch.equal(described(k, other), described(k, evecs))
    assert not torch.equal(described(k - 1, other), described(k, evecs))
