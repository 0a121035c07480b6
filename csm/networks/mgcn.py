"""MGCN: convolutions with wavelets of many scales."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from torch import Tensor, nn
from torch.nn.functional import elu

from csm.networks.mgconv import MGConv, Products, WaveletOperators
from csm.networks.surface import Surface


class MGCN(nn.Module):
    """Multiscale graph convolutional network: six MGConv, MLP256, and a classifier over the template vertices.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor, WEDS in the original.
    n_classes
        Number of template vertices.
    channels
        Widths of the convolutions.
    descriptor_channels
        Width of the learned descriptor.
    ks
        Number of eigenpairs that are not constant, of which the wavelets are made.
    filters
        Size of the bank of filters; every second one, without the low-pass, is a wavelet.
    tolerance
        What the sparse wavelets may lose of their sum, see `csm.operators.stencils.wavelets.Wavelets`; 0 is exact.
    products
        Precision of the sums over vertices, see `WaveletOperators`.
    dropout
        Between descriptor and classifier.

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
            raise ValueError(f'products is "float32" or "bfloat16", got {products!r}')
        self.products: Products = products
        widths = itertools.pairwise((in_channels, *channels))
        self.convs = nn.ModuleList(MGConv(a, b, wavelets=filters // 2) for a, b in widths)
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.dropout = nn.Dropout(dropout)
        self.classifier = nn.Linear(descriptor_channels, n_classes)

    @staticmethod
    def stencils(ks: int = 300, filters: int = 32, tolerance: float = 1e-3, **_: Any) -> dict[str, dict[str, Any]]:
        """Return what the network wants to know of a shape: the wavelets."""
        return {"wavelets": {"k": ks, "n_filters": filters, "tolerance": tolerance}}

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, descriptor_channels), of input features `x`, shape (N, P)."""
        operators = WaveletOperators(surface.stencil("wavelets"), x.dtype, self.products)
        for conv in self.convs:
            x = elu(conv(x, operators))
        y: Tensor = elu(self.embed(x))
        return y

    def forward(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the logits over the template vertices, shape (N, n_classes)."""
        y: Tensor = self.classifier(self.dropout(self.describe(x, surface)))
        return y
