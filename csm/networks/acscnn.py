"""ACSCNN: Chebyshev filters of anisotropic Laplacians."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from csm.networks.sparse import chebyshev_filter, symmetric_matrix
from csm.networks.surface import Surface


class ACSConv(nn.Module):
    r"""Sum of Chebyshev filters, one for each of the J angles of the anisotropic Laplacian.

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
        """Draw the weights Xavier-uniformly as the released code does, and set the bias to zero.

        For a tensor of three axes PyTorch takes the fans to be (J C_in + K) C_out together.
        """
        nn.init.xavier_uniform_(self.weight)
        nn.init.zeros_(self.bias)

    def forward(self, x: Tensor, laplacians: Sequence[Tensor], root_mass: Tensor) -> Tensor:
        """Filter the functions `x`.

        Parameters
        ----------
        x
            Shape (N, C_in).
        laplacians
            J sparse matrices M = A^1/2 L A^-1/2, (N, N), see `laplacians_of`.
        root_mass
            Shape (N, 1): the diagonal of A^1/2.
        """
        terms, _, fan_out = self.weight.shape
        weight = self.weight.view(terms, self.angles, -1, fan_out)
        return chebyshev_filter(root_mass * x, weight, laplacians) / root_mass + self.bias

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        terms, fan_in, fan_out = self.weight.shape
        return f"{fan_in // self.angles}, {fan_out}, terms={terms}, angles={self.angles}"


class ACSCNN(nn.Module):
    """Anisotropic Chebyshev spectral CNN: six ACSConv, MLP256, and a classifier over the template vertices.

    Batch normalisation and a ReLU follow every convolution, a ReLU the 256-wide layer, whose output is the learned
    descriptor.  The filters reach terms - 1 rings around a vertex.

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
        Strength of the anisotropy, and number of angles.
    frame, sweeps, smoothing
        Of `csm.operators.frames.face_frames`.  The default is the released code's frame without its dependence on the
        world axes; "smooth" is csm's own and depends less on the resolution.
    dropout
        Between descriptor and classifier.

    References
    ----------
    Li et al., "Shape correspondence using anisotropic Chebyshev spectral CNNs", CVPR 2020; sizes as in the released
    code.
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
    ) -> None:
        super().__init__()
        widths = itertools.pairwise((in_channels, *channels))
        self.convs = nn.ModuleList(ACSConv(a, b, terms, angles) for a, b in widths)
        self.norms = nn.ModuleList(nn.BatchNorm1d(width) for width in channels)
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.dropout = nn.Dropout(dropout)
        self.classifier = nn.Linear(descriptor_channels, n_classes)

    @staticmethod
    def stencils(
        alpha: float = 10.0,
        angles: int = 8,
        frame: str = "line_field",
        sweeps: int = 10,
        smoothing: float = 0.08,
        **_: Any,
    ) -> dict[str, dict[str, Any]]:
        """Return the stencil of a network with these options: the anisotropic Laplacians."""
        parameters = {"alpha": alpha, "angles": angles, "frame": frame, "sweeps": sweeps, "smoothing": smoothing}
        return {"albo": parameters}

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, descriptor_channels), of input features `x`, shape (N, P)."""
        laplacians, root_mass = laplacians_of(surface), surface.basis.mass.sqrt()[:, None]
        for conv, norm in zip(self.convs, self.norms, strict=True):
            x = torch.relu(norm(conv(x, laplacians, root_mass)))
        return torch.relu(self.embed(x))

    def forward(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the logits over the template vertices, shape (N, n_classes)."""
        y: Tensor = self.classifier(self.dropout(self.describe(x, surface)))
        return y


def laplacians_of(surface: Surface) -> tuple[Tensor, ...]:
    """Return the stencil "albo" as sparse tensors, (N, N) each and symmetric, one per angle."""
    stencil = surface.stencil("albo")
    indptr, indices = stencil["indptr"].int(), stencil["indices"].int()  # once for all angles
    return tuple(symmetric_matrix(indptr, indices, values) for values in stencil["values"])
