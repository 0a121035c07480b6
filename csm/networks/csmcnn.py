"""CSMCNN: the spectral network of the paper."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Literal, get_args

import torch
from torch import Tensor, nn

from csm.networks.csmconv import BiasDomain, CSMConv
from csm.networks.surface import Surface

Normalisation = Literal["batch", "instance", "none"]
Activation = Literal["relu", "elu", "leaky_relu", "gelu"]

ACTIVATIONS: dict[str, type[nn.Module]] = {
    "relu": nn.ReLU,
    "elu": nn.ELU,
    "leaky_relu": nn.LeakyReLU,
    "gelu": nn.GELU,
}


class CSMCNN(nn.Module):
    """Chebyshev spectral manifold network: MLP64, three CSMConv, MLP256, and a classifier over the template vertices.

    The learned descriptor is the output of the 256-wide layer; the classifier only serves the training and is not
    needed to match shapes.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    channels
        Width of the first linear layer and of each spectral convolution after it.
    descriptor_channels
        Width of the learned descriptor.
    ks
        Number K_s of eigenpairs that the convolutions use.
    terms
        Number of Chebyshev polynomials per convolution, T_0 .. T_{terms-1}.
    normalisation
        "batch" (running statistics at test time), "instance" (each shape's own statistics, at training and at test
        time) or "none", after every layer.
    momentum, eps
        Of the batch normalisation, in PyTorch's sense.
    dropout
        Between descriptor and classifier.
    activation
        "relu", "elu", "leaky_relu" or "gelu", after every layer.
    bias
        Where the convolutions add their bias, see `CSMConv`.

    Notes
    -----
    The paper's text names neither the normalisation, the activation nor the number of terms; the defaults are those of
    the released code, except that the batch normalisation's momentum is PyTorch's.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        channels: Sequence[int] = (64, 64, 64, 128),
        descriptor_channels: int = 256,
        ks: int = 64,
        terms: int = 6,
        normalisation: Normalisation = "batch",
        momentum: float = 0.1,
        eps: float = 1e-5,
        dropout: float = 0.5,
        activation: Activation = "relu",
        bias: BiasDomain = "spatial",
    ) -> None:
        super().__init__()
        self.ks = ks
        self.lift = nn.Linear(in_channels, channels[0])
        self.convs = nn.ModuleList(CSMConv(a, b, terms, bias) for a, b in itertools.pairwise(channels))
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.finish = nn.ModuleList(
            finishing(width, normalisation, activation, momentum, eps) for width in (*channels, descriptor_channels)
        )
        self.dropout = nn.Dropout(dropout)
        self.classifier = nn.Linear(descriptor_channels, n_classes)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, descriptor_channels), of input features `x`, shape (N, P)."""
        basis = surface.basis.first(self.ks)
        x = self.finish[0](self.lift(x))
        for conv, finish in zip(self.convs, self.finish[1:-1], strict=True):
            x = finish(conv(x, basis))
        y: Tensor = self.finish[-1](self.embed(x))
        return y

    def filters(self, evals: Tensor) -> dict[str, Tensor]:
        """Return the learned filters of each convolution at the eigenvalues, name -> (K_s, C_in, C_out)."""
        return {f"conv{i}": conv.filters(evals[: self.ks]) for i, conv in enumerate(self.convs, 1)}  # type: ignore[operator]

    def forward(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the logits over the template vertices, shape (N, n_classes)."""
        y: Tensor = self.classifier(self.dropout(self.describe(x, surface)))
        return y


class VertexNorm(nn.Module):
    """Normalise each channel by its mean and variance over the vertices of the shape, then scale and shift."""

    def __init__(self, channels: int, eps: float) -> None:
        super().__init__()
        self.eps = eps
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        """Normalise `x`, shape (N, C), along its first axis."""
        centred = x - x.mean(0)
        y: Tensor = centred * (centred.square().mean(0) + self.eps).rsqrt() * self.weight + self.bias
        return y


def finishing(
    width: int, normalisation: Normalisation, activation: Activation, momentum: float, eps: float
) -> nn.Sequential:
    """Return what comes after a layer of this width: its normalisation, if any, and its activation.

    Raises
    ------
    ValueError
        If the normalisation or the activation is unknown.
    """
    if activation not in ACTIVATIONS:
        raise ValueError(f"activation is one of {', '.join(ACTIVATIONS)}, got {activation!r}")
    if normalisation not in get_args(Normalisation):
        raise ValueError(f'normalisation is "batch", "instance" or "none", got {normalisation!r}')
    layers: list[nn.Module] = [ACTIVATIONS[activation]()]
    if normalisation == "batch":
        layers.insert(0, nn.BatchNorm1d(width, eps=eps, momentum=momentum))
    elif normalisation == "instance":
        layers.insert(0, VertexNorm(width, eps))
    return nn.Sequential(*layers)
