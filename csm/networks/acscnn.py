"""ACSCNN: a network whose convolutions are Chebyshev filters of anisotropic Laplacians."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from csm.networks.base import ConvolutionalNetwork
from csm.networks.sparse import chebyshev_filter, symmetric_matrix
from csm.networks.surface import Surface


class ACSConv(nn.Module):
    r"""Convolution that sums the Chebyshev filters of the anisotropic Laplacians of J angles.

    .. math::
        y = b + \sum_{k=0}^{K-1} \big[ T_k(\tilde L_1)\,x \,|\, \dots \,|\, T_k(\tilde L_J)\,x \big] W_k

    Parameters
    ----------
    in_channels, out_channels
        Channels C_in of the input and C_out of the output functions.
    terms
        Number K of Chebyshev polynomials.
    angles
        Number J of angles.

    Shapes
    ------
    input (N, C_in), output (N, C_out); weight (K, J C_in, C_out), bias (C_out,).
    """

    def __init__(self, in_channels: int, out_channels: int, terms: int = 16, angles: int = 8) -> None:
        super().__init__()
        if terms < 1 or angles < 1:
            raise ValueError(f"ACSConv needs terms and angles of at least 1, got {terms} and {angles}")
        self.angles = angles
        self.weight = nn.Parameter(torch.empty(terms, angles * in_channels, out_channels))
        self.bias = nn.Parameter(torch.zeros(out_channels))
        self.reset_parameters()

    def reset_parameters(self) -> None:
        """Draw the weights Xavier-uniformly, as the released code does, and set the bias to zero.

        For a tensor of three axes PyTorch takes the sum of fan-in and fan-out to be (J C_in + K) C_out.
        """
        nn.init.xavier_uniform_(self.weight)
        nn.init.zeros_(self.bias)

    def forward(self, x: Tensor, laplacians: Sequence[Tensor], root_mass: Tensor) -> Tensor:
        """Return the filtered functions, shape (N, C_out).

        Parameters
        ----------
        x
            Functions, shape (N, C_in).
        laplacians
            The J sparse symmetric matrices M = A^1/2 L A^-1/2, shape (N, N) each, that `laplacians_of` returns.
        root_mass
            Square roots of the vertex areas, which are the diagonal of A^1/2, shape (N, 1).
        """
        terms, _, fan_out = self.weight.shape
        weight = self.weight.view(terms, self.angles, -1, fan_out)
        return chebyshev_filter(root_mass * x, weight, laplacians) / root_mass + self.bias

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        terms, fan_in, fan_out = self.weight.shape
        return f"{fan_in // self.angles}, {fan_out}, terms={terms}, angles={self.angles}"


class ACSCNN(ConvolutionalNetwork):
    """Anisotropic Chebyshev spectral CNN: six ACSConv, a linear layer of 256 channels, and the classifier.

    Batch normalisation and a ReLU follow every convolution, and a ReLU follows the linear layer, whose output is the
    learned descriptor.  The filter of one convolution reaches terms - 1 rings around a vertex.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    channels
        Width of each convolution.
    descriptor_channels
        Width of the learned descriptor.
    terms
        Number of Chebyshev polynomials per convolution, T_0 .. T_{terms-1}.
    alpha, angles
        Strength of the anisotropy, and number J of angles.
    frame, sweeps, smoothing
        How the tangent frames of the faces are found, as in `csm.operators.frames.face_frames`.  The default is the
        frame of the released code without its dependence on the world axes; "smooth" is csm's own frame, which depends
        less on the resolution of the mesh.
    dropout
        Dropout between the learned descriptor and the classifier.
    lift_channels
        Width of a linear layer with ReLU before the convolutions, as CSMCNN has one; 0 for none, as published.  With it
        an input of many columns costs no more than one of so many.

    References
    ----------
    Li et al., "Shape correspondence using anisotropic Chebyshev spectral CNNs", CVPR 2020; the sizes are those of
    the released code.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        channels: Sequence[int] = (64, 64, 64, 64, 64, 64),
        descriptor_channels: int = 256,
        terms: int = 16,
        alpha: float = 10.0,
        angles: int = 8,
        frame: str = "line_field",
        sweeps: int = 10,
        smoothing: float = 0.08,
        dropout: float = 0.5,
        lift_channels: int = 0,
    ) -> None:
        super().__init__()
        if lift_channels < 0:
            raise ValueError(f"ACSCNN: lift_channels is 0 for none, or a width, got {lift_channels}")
        self.lift = nn.Linear(in_channels, lift_channels) if lift_channels else None
        widths = itertools.pairwise((lift_channels or in_channels, *channels))
        self.convs = nn.ModuleList(ACSConv(a, b, terms, angles) for a, b in widths)
        self.norms = nn.ModuleList(nn.BatchNorm1d(width) for width in channels)
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.add_classifier(descriptor_channels, n_classes, dropout)
        self.albo = {"alpha": alpha, "angles": angles, "frame": frame, "sweeps": sweeps, "smoothing": smoothing}

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencil that the convolutions filter by: the anisotropic Laplacians, "albo"."""
        return {"albo": dict(self.albo)}

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the anisotropic Laplacians of all angles, and the square roots of the vertex areas, shape (N, 1)."""
        return laplacians_of(surface), surface.basis.mass.sqrt()[:, None]

    def lifted(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the input of the first convolution, shape (N, P) or (N, lift_channels)."""
        return x if self.lift is None else torch.relu(self.lift(x))

    def activated(self, x: Tensor, layer: int, surface: Surface) -> Tensor:
        """Return the output `x`, shape (N, C), of a layer after batch normalisation (of convolutions only) and ReLU."""
        return torch.relu(self.norms[layer](x) if layer < len(self.norms) else x)


def laplacians_of(surface: Surface) -> tuple[Tensor, ...]:
    """Return the stencil "albo" as J sparse symmetric tensors, shape (N, N), one for each angle."""
    stencil = surface.stencil("albo")
    indptr, indices = stencil["indptr"].int(), stencil["indices"].int()  # is converted once for all angles
    return tuple(symmetric_matrix(indptr, indices, values) for values in stencil["values"])
