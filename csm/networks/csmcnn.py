"""CSMCNN: the spectral network of the paper."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, Literal, get_args

import torch
from torch import Tensor, nn

from csm.networks.base import ConvolutionalNetwork
from csm.networks.csmconv import BiasDomain, CSMConv
from csm.networks.sparse import widened
from csm.networks.surface import Surface

Normalisation = Literal["batch", "instance", "area", "none"]
Activation = Literal["relu", "elu", "leaky_relu", "gelu"]

ACTIVATIONS: dict[str, type[nn.Module]] = {
    "relu": nn.ReLU,
    "elu": nn.ELU,
    "leaky_relu": nn.LeakyReLU,
    "gelu": nn.GELU,
}


class CSMCNN(ConvolutionalNetwork):
    """Chebyshev spectral manifold network: a linear layer, three CSMConv, a second linear layer, and the classifier.

    The learned descriptor is the output of the second linear layer; the classifier only serves the training and is not
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
        What every layer is followed by before its activation: "batch" (with running statistics at test time),
        "instance" (with each shape's own statistics, in training and at test time), "area" (the same with every vertex
        weighted by its area, so that it depends less on the triangulation) or "none".
    momentum, eps
        Options of the batch normalisation, in PyTorch's sense; the other normalisations have the same `eps`.
    dropout
        Dropout between the learned descriptor and the classifier.
    activation
        What every layer ends with: "relu", "elu", "leaky_relu" or "gelu".
    bias
        Where the convolutions add their bias, "spatial" or "spectral", as in `CSMConv`.

    Notes
    -----
    The text of the paper names neither the normalisation, nor the activation, nor the number of terms.  The defaults
    are those of the released code, except that the batch normalisation's momentum and eps are PyTorch's.
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
        self.add_classifier(descriptor_channels, n_classes, dropout)

    @property
    def n_eigenpairs(self) -> int:
        """Number K_s of eigenpairs that the convolutions use."""
        return self.ks

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the basis of the K_s lowest eigenpairs."""
        return (surface.basis.first(self.ks),)

    def lifted(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the first linear layer's output, shape (N, channels[0]), of the input descriptor, shape (N, P)."""
        y: Tensor = self.finish[0](self.lift(x), surface.basis.mass)
        return y

    def activated(self, x: Tensor, layer: int, surface: Surface) -> Tensor:
        """Return the output `x`, shape (N, C), of a layer after its normalisation and activation."""
        y: Tensor = self.finish[layer + 1](x, surface.basis.mass)
        return y

    def filters(self, evals: Tensor) -> dict[str, Tensor]:
        """Return the learned filters of each convolution, "conv1" and on, at the first K_s of the eigenvalues.

        Parameters
        ----------
        evals
            Eigenvalues, shape (K,), ascending, with K of at least K_s.

        Returns
        -------
        dict[str, Tensor]
            From the name of a convolution to its filters, shape (K_s, C_in, C_out).
        """
        return {f"conv{i}": conv.filters(evals[: self.ks]) for i, conv in enumerate(self.convs, 1)}  # type: ignore[operator]


class VertexNorm(nn.Module):
    """Normalise each channel by its mean and variance over the vertices of the shape, then scale and shift it.

    Parameters
    ----------
    channels
        Number C of channels.
    eps
        Added to the variance.
    by_area
        Weight every vertex by its area.

    Shapes
    ------
    input and output (N, C); areas (N,); weight and bias (C,).
    """

    def __init__(self, channels: int, eps: float, by_area: bool = False) -> None:
        super().__init__()
        self.eps, self.by_area = eps, by_area
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor, areas: Tensor) -> Tensor:
        """Return the functions `x`, shape (N, C), normalised over the N vertices, which have these areas."""
        x = widened(x)
        share = (areas if self.by_area else torch.ones_like(areas)).to(x.dtype)
        share = share / share.sum()
        centred = x - share @ x
        y: Tensor = centred * (share @ centred.square() + self.eps).rsqrt() * self.weight + self.bias
        return y


class Finishing(nn.ModuleList):
    """What follows a layer: its normalisation, if it has one, and its activation."""

    def forward(self, x: Tensor, areas: Tensor) -> Tensor:
        """Return the functions `x`, shape (N, C), on a shape with these vertex areas, shape (N,), finished."""
        for layer in self:
            x = layer(x, areas) if isinstance(layer, VertexNorm) else layer(x)
        return x


def finishing(
    width: int, normalisation: Normalisation, activation: Activation, momentum: float, eps: float
) -> Finishing:
    """Return what follows a layer of this width: its normalisation, if it has one, and its activation.

    Raises
    ------
    ValueError
        If the normalisation or the activation is unknown.
    """
    if activation not in ACTIVATIONS:
        raise ValueError(f"activation must be one of {', '.join(ACTIVATIONS)}, got {activation!r}")
    if normalisation not in get_args(Normalisation):
        raise ValueError(f'normalisation must be "batch", "instance", "area" or "none", got {normalisation!r}')
    layers: list[nn.Module] = [ACTIVATIONS[activation]()]
    if normalisation == "batch":
        layers.insert(0, nn.BatchNorm1d(width, eps=eps, momentum=momentum))
    elif normalisation in ("instance", "area"):
        layers.insert(0, VertexNorm(width, eps, by_area=normalisation == "area"))
    return Finishing(layers)
