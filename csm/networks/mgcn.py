"""MGCN: a network whose convolutions average with wavelets of many scales."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import torch
from torch import nn

from csm.networks.base import ConvolutionalNetwork
from csm.networks.mgconv import MGConv, Products, WaveletOperators
from csm.networks.surface import Surface


class MGCN(ConvolutionalNetwork):
    """Multiscale graph convolutional network: six MGConv, a linear layer of 256 channels, and the classifier.

    ELU follows every layer.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor, which is WEDS in the original.
    n_classes
        Number of template vertices.
    channels
        Width of each convolution.
    descriptor_channels
        Width of the learned descriptor.
    ks
        Number of eigenpairs, without the constant one, that the wavelets are made of.  The stencil brings them, so the
        basis of the surface need not have as many.
    filters
        Size of the bank of filters; every second one of them, without the low-pass filter, is a wavelet.
    tolerance
        What the sparse wavelets may lose of their sum, as in `csm.operators.stencils.wavelets.Wavelets`; 0 is exact.
    products
        Precision of the sums over vertices, "float32" or "bfloat16", as in `WaveletOperators`.
    dropout
        Dropout between the learned descriptor and the classifier.

    References
    ----------
    Wang, Ren, Yan, Guo, Zhang, Wonka, "MGCN: descriptor learning using multiscale GCNs", TOG (SIGGRAPH) 2020, and its
    published code.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        channels: Sequence[int] = (96, 96, 96, 96, 96, 128),
        descriptor_channels: int = 256,
        ks: int = 300,
        filters: int = 32,
        tolerance: float = 1e-3,
        products: Products = "float32",
        dropout: float = 0.5,
    ) -> None:
        super().__init__()
        if products not in ("float32", "bfloat16"):
            raise ValueError(f'products must be "float32" or "bfloat16", got {products!r}')
        self.products: Products = products
        widths = itertools.pairwise((in_channels, *channels))
        self.convs = nn.ModuleList(MGConv(a, b, wavelets=filters // 2) for a, b in widths)
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.add_classifier(descriptor_channels, n_classes, dropout)
        self.wavelets = {"k": ks, "n_filters": filters, "tolerance": tolerance}

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencil that the convolutions average with: the wavelets."""
        return {"wavelets": dict(self.wavelets)}

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the wavelets of the surface as operators on functions of the given dtype."""
        return (WaveletOperators(surface.stencil("wavelets"), dtype, self.products),)
