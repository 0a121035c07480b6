"""ChebyNet: a network whose convolutions are polynomials of the mesh's sparse Laplacian."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from csm.networks.base import ConvolutionalNetwork
from csm.networks.csmconv import reset_terms
from csm.networks.sparse import chebyshev_filter, symmetric_matrix
from csm.networks.surface import Surface


class ChebyNet(ConvolutionalNetwork):
    """Six Chebyshev graph convolutions and a linear layer of 256 channels, with ELU after each, and the classifier.

    It serves as a reference for locality: a convolution of K terms sees the K - 1 rings around a vertex, whereas
    `CSMConv` sees the whole shape.

    Parameters
    ----------
    in_channels
        Width P of the input features.
    n_classes
        Number of template vertices.
    channels
        Width of each convolution.
    descriptor_channels
        Width of the learned descriptor.
    terms
        Number K of Chebyshev polynomials per convolution, T_0 .. T_{K-1}.
    laplacian
        "graph" or "cotangent", as in `csm.operators.stencils.scaled_laplacian.ScaledLaplacian`.
    dropout
        Dropout between the learned descriptor and the classifier.

    Notes
    -----
    The method was published for other data than shapes; the widths, ELU and the dropout are those of `SplineCNN`.

    References
    ----------
    Defferrard, Bresson, Vandergheynst, "Convolutional neural networks on graphs with fast localized spectral
    filtering", NeurIPS 2016.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        channels: Sequence[int] = (32, 64, 64, 64, 64, 64),
        descriptor_channels: int = 256,
        terms: int = 6,
        laplacian: str = "graph",
        dropout: float = 0.5,
    ) -> None:
        super().__init__()
        if laplacian not in ("graph", "cotangent"):
            raise ValueError(f'laplacian must be "graph" or "cotangent", got {laplacian!r}')
        self.convs = nn.ModuleList(ChebConv(a, b, terms) for a, b in itertools.pairwise((in_channels, *channels)))
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.add_classifier(descriptor_channels, n_classes, dropout)
        self.laplacian = laplacian

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencil that the convolutions are polynomials of: the scaled Laplacian."""
        return {"scaled_laplacian": {"laplacian": self.laplacian}}

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the scaled Laplacian of the surface."""
        return (laplacian_of(surface, dtype),)


def laplacian_of(surface: Surface, dtype: torch.dtype) -> Tensor:
    """Return the stencil "scaled_laplacian" as a sparse symmetric tensor, shape (N, N)."""
    stencil = surface.stencil("scaled_laplacian")
    return symmetric_matrix(stencil["indptr"], stencil["indices"], stencil["values"].to(dtype))


class ChebConv(nn.Module):
    r"""Chebyshev graph convolution  y = \sum_{k=0}^{K-1} T_k(\tilde L)\, x\, W_k + b.

    Parameters
    ----------
    in_channels, out_channels
        Channels C_in of the input and C_out of the output functions.
    terms
        Number K of Chebyshev polynomials, at least 1.

    Shapes
    ------
    input (N, C_in), output (N, C_out); weight (K, C_in, C_out), bias (C_out,).
    """

    def __init__(self, in_channels: int, out_channels: int, terms: int = 6) -> None:
        super().__init__()
        if terms < 1:
            raise ValueError(f"ChebConv needs at least one Chebyshev term, got {terms}")
        self.weight = nn.Parameter(torch.empty(terms, in_channels, out_channels))
        self.bias = nn.Parameter(torch.zeros(out_channels))
        self.reset_parameters()

    def reset_parameters(self) -> None:
        """Draw the weights Xavier-uniformly with the fan of all terms together, and set the bias to zero."""
        reset_terms(self.weight, self.bias)

    def forward(self, x: Tensor, laplacian: Tensor) -> Tensor:
        """Convolve the functions `x`, shape (N, C_in), by the matrix that `laplacian_of` returns."""
        return chebyshev_filter(x, self.weight[:, None], (laplacian,)) + self.bias

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        terms, fan_in, fan_out = self.weight.shape
        return f"{fan_in}, {fan_out}, terms={terms}"
