"""GCNN: a network whose convolutions compare geodesic patches, turned in every direction, with filters."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.checkpoint import checkpoint

from csm.networks.base import ConvolutionalNetwork
from csm.networks.csmcnn import Activation, Normalisation, finishing
from csm.networks.surface import Surface

CHUNK = 512
"""Patches that are in memory together."""


class Patches(NamedTuple):
    """The windows of all vertices as the rows of a sparse matrix: `indptr` (N S T + 1,), `indices`, `values` (nnz,)."""

    indptr: Tensor
    indices: Tensor
    values: Tensor


class GeodesicConv(nn.Module):
    r"""Geodesic convolution with angular max pooling.

    With the patch D(x) of S rings and T rays around a vertex x,

    .. math::
        y(x) = b + \max_{u = 0 \ldots T - 1} \sum_{s, t} D_{s,\, t + u}(x) \, W_{st}

    where rays are counted modulo T, and the maximum is taken channel by channel.

    Parameters
    ----------
    in_channels, out_channels
        Channels C_in of the input and C_out of the output functions.
    rings, rays
        S and T.

    Shapes
    ------
    input (N, C_in), output (N, C_out); weight (S, T, C_in, C_out), bias (C_out,).
    """

    def __init__(self, in_channels: int, out_channels: int, rings: int = 5, rays: int = 16) -> None:
        super().__init__()
        if rings < 1 or rays < 1:
            raise ValueError(f"GeodesicConv needs rings and rays of at least 1, got {rings} and {rays}")
        self.weight = nn.Parameter(torch.empty(rings, rays, in_channels, out_channels))
        self.bias = nn.Parameter(torch.zeros(out_channels))
        self.reset_parameters()

    def reset_parameters(self) -> None:
        """Draw the weights Glorot-normally, as the authors do later, and set the bias to zero."""
        rings, rays, fan_in, fan_out = self.weight.shape
        nn.init.normal_(self.weight, std=(2 / (rings * rays * (fan_in + fan_out))) ** 0.5)
        nn.init.zeros_(self.bias)

    def forward(self, x: Tensor, patches: Patches) -> Tensor:
        """Convolve the functions `x`, shape (N, C_in), on the shape with these patches.

        A chunk of patches is made, compared and forgotten, and made again in the backward pass, so that memory does not
        grow with S T N.  Where a chunk begins is asked of the device, for which each chunk waits.
        """
        size = CHUNK * self.weight.shape[0] * self.weight.shape[1]
        parts = []
        for start in range(0, len(patches.indptr) - 1, size):
            indptr = patches.indptr[start : start + size + 1]
            first, last = int(indptr[0]), int(indptr[-1])
            chunk = Patches(indptr - first, patches.indices[first:last], patches.values[first:last])
            parts.append(checkpoint(_pooled, x, self.weight, chunk, use_reentrant=False, preserve_rng_state=False))
        return torch.cat(parts) + self.bias

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        rings, rays, fan_in, fan_out = self.weight.shape
        return f"{fan_in}, {fan_out}, rings={rings}, rays={rays}"


def correlation(patches: Tensor, weight: Tensor) -> Tensor:
    """Return  sum_st D_{s, t + u} W_st  for each turn u.

    The sum over rays is a product of Fourier coefficients, which takes a seventh of the operations.

    Parameters
    ----------
    patches
        D, shape (B, S, T, C_in).
    weight
        W, shape (S, T, C_in, C_out).

    Returns
    -------
    Tensor
        Shape (B, T, C_out).
    """
    rays = weight.shape[1]
    d = torch.fft.rfft(patches, dim=2).permute(2, 0, 1, 3).flatten(2)
    w = torch.fft.rfft(weight, dim=1).conj().transpose(0, 1).flatten(1, 2)
    turned: Tensor = torch.fft.irfft(torch.bmm(d, w), n=rays, dim=0)
    return turned.transpose(0, 1)


def _pooled(x: Tensor, weight: Tensor, patches: Patches) -> Tensor:
    """Return the greatest response over all turns, shape (B, C_out), of B patches."""
    rings, rays, fan_in, _ = weight.shape
    values = patches.values
    made = functional.embedding_bag(
        patches.indices,
        x.to(values.dtype),
        patches.indptr,
        mode="sum",
        per_sample_weights=values,
        include_last_offset=True,
    )
    return correlation(made.view(-1, rings, rays, fan_in), weight).amax(dim=1)


class GCNN(ConvolutionalNetwork):
    """Geodesic CNN: a linear layer, three geodesic convolutions, a linear layer of 256 channels, and the classifier.

    A normalisation and a ReLU follow each of them; the output after the last linear layer is the learned descriptor.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor: geometry vectors in the original.
    n_classes
        Number of template vertices.
    channels
        Width of the first linear layer, then of each convolution.  A guess, as is that of the descriptor: it is how
        later papers describe the network; its own text was not available.
    descriptor_channels
        Width of the learned descriptor.
    radius
        Of the patches, as a fraction of the geodesic diameter; that of the authors' public preparation.
    rings, rays
        Of the patches; those of the same.
    spread
        Width of the windows, of `csm.operators.stencils.polar_patches.PolarPatches`.  A guess: the authors' windows are
        narrower, and leave those empty that no vertex falls into.
    normalisation, momentum, eps, activation
        What every layer is followed by, as in `CSMCNN`.  A guess: batch normalisation is in their later code.
    dropout
        Dropout between the learned descriptor and the classifier.  A guess: that of the other networks.

    Notes
    -----
    A patch has no first ray, so nothing depends on where rays are counted from, except that they sample the patch at
    other places; and a mirror image has other descriptors, since filters turn but do not flip.

    References
    ----------
    Masci, Boscaini, Bronstein, Vandergheynst, "Geodesic convolutional neural networks on Riemannian manifolds", 3dRR
    2015, with the public preparation of its patches and the layer of its authors' Eurographics tutorial of 2016.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        channels: Sequence[int] = (16, 32, 64, 128),
        descriptor_channels: int = 256,
        radius: float = 0.01,
        rings: int = 5,
        rays: int = 16,
        spread: float = 0.5,
        normalisation: Normalisation = "batch",
        momentum: float = 0.1,
        eps: float = 1e-5,
        dropout: float = 0.5,
        activation: Activation = "relu",
    ) -> None:
        super().__init__()
        self.lift = nn.Linear(in_channels, channels[0])
        self.convs = nn.ModuleList(GeodesicConv(a, b, rings, rays) for a, b in itertools.pairwise(channels))
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        widths = (*channels, descriptor_channels)
        self.finish = nn.ModuleList(finishing(width, normalisation, activation, momentum, eps) for width in widths)
        self.add_classifier(descriptor_channels, n_classes, dropout)
        self.patches = {"radius": radius, "rings": rings, "rays": rays, "spread": spread}

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencil that the convolutions take patches with."""
        return {"polar_patches": dict(self.patches)}

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the patches of all vertices."""
        found = surface.stencil("polar_patches")
        return (Patches(found["indptr"].long(), found["indices"].long(), found["values"].to(dtype)),)

    def lifted(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the first linear layer's output, shape (N, channels[0]), of the input descriptor, shape (N, P)."""
        y: Tensor = self.finish[0](self.lift(x), surface.basis.mass)
        return y

    def activated(self, x: Tensor, layer: int, surface: Surface) -> Tensor:
        """Return the output `x`, shape (N, C), of a layer after its normalisation and activation."""
        y: Tensor = self.finish[layer + 1](x, surface.basis.mass)
        return y
