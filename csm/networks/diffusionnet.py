"""DiffusionNet: a network of diffusion for learned times, gradients, and a perceptron at every vertex."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from csm.networks.base import CorrespondenceNetwork
from csm.networks.basis import Basis
from csm.networks.sparse import Csr, spmm
from csm.networks.surface import Surface

LEAST_TIME = 1e-8
"""Least time of diffusion, in units of area."""


class Diffusion(nn.Module):
    r"""Heat flow on the shape, for a learned time t of each channel: y = Phi exp(-Lambda t) Phi^T A x.

    The times start at zero and are raised to at least `LEAST_TIME` before every use.  The part of the input that is
    not in the span of the eigenbasis is lost.

    Shapes
    ------
    input and output (N, C), basis with K eigenpairs; time (C,).
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.time = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor, basis: Basis) -> Tensor:
        """Diffuse the functions `x`, shape (N, C)."""
        with torch.no_grad():
            self.time.clamp_(min=LEAST_TIME)
        return basis.synthesize(torch.exp(-basis.evals[:, None] * self.time) * basis.project(x))


class GradientFeatures(nn.Module):
    r"""Products of the gradients of all channels at a vertex, which are complex numbers g = g_x + i g_y.

    .. math::
        y = \tanh\,\mathrm{Re}\,\big(\bar g \odot B g\big), \qquad B = B_{re} + i B_{im}

    Turning the tangent frame of a vertex changes nothing.  In a mirror image the sign in front of B_im is the opposite,
    which is how the network tells left from right.

    Shapes
    ------
    two inputs (N, C), output (N, C); weights of `real` and `imaginary` (C, C).
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.real = nn.Linear(channels, channels, bias=False)
        self.imaginary = nn.Linear(channels, channels, bias=False)

    def forward(self, gx: Tensor, gy: Tensor) -> Tensor:
        """Return the features, shape (N, C), of the gradients with the components `gx` and `gy`, shape (N, C) each."""
        along = self.real(gx) - self.imaginary(gy)
        across = self.real(gy) + self.imaginary(gx)
        return torch.tanh(gx * along + gy * across)


class DiffusionBlock(nn.Module):
    """Add to the input what a perceptron makes of it, of its diffusion, and of the gradient features of that.

    Shapes
    ------
    input and output (N, C).
    """

    def __init__(self, channels: int, dropout: float) -> None:
        super().__init__()
        self.diffusion = Diffusion(channels)
        self.gradient_features = GradientFeatures(channels)
        self.perceptron = nn.Sequential(
            nn.Linear(3 * channels, channels),
            nn.ReLU(),
            nn.Dropout(dropout),
            nn.Linear(channels, channels),
            nn.ReLU(),
            nn.Dropout(dropout),
            nn.Linear(channels, channels),
        )

    def forward(self, x: Tensor, basis: Basis, gradient: Gradient) -> Tensor:
        """Return the new functions, shape (N, C), of functions `x`, shape (N, C)."""
        diffused = self.diffusion(x, basis)
        features = self.gradient_features(*gradient(diffused))
        y: Tensor = x + self.perceptron(torch.cat([x, diffused, features], dim=1))
        return y


class DiffusionNet(CorrespondenceNetwork):
    """A linear layer, four blocks of diffusion, gradients and perceptron, and the classifier.

    The learned descriptor is what the classifier reads: the last block's output, or a linear map of it if
    `descriptor_channels` is given.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    width
        Number of channels of every block.
    blocks
        Number of blocks.
    ks
        Number of eigenpairs that the diffusion uses.
    descriptor_channels
        Width of the learned descriptor.  None means that the output of the last block is the learned descriptor, as
        published, without a linear layer in between.
    regularisation
        Regularisation of the gradients, as in `csm.operators.stencils.gradients.VertexGradients`.
    block_dropout
        Dropout inside the perceptron of every block.
    dropout
        Dropout between the learned descriptor and the classifier; the published network has none.

    References
    ----------
    Sharp et al., "DiffusionNet: discretization agnostic learning on surfaces", TOG 2022; the layers are those of the
    released code.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        width: int = 128,
        blocks: int = 4,
        ks: int = 128,
        descriptor_channels: int | None = None,
        regularisation: float = 1e-5,
        block_dropout: float = 0.5,
        dropout: float = 0.0,
    ) -> None:
        super().__init__()
        self.ks = ks
        self.lift = nn.Linear(in_channels, width)
        self.blocks = nn.ModuleList(DiffusionBlock(width, block_dropout) for _ in range(blocks))
        self.embed = nn.Identity() if descriptor_channels is None else nn.Linear(width, descriptor_channels)
        self.add_classifier(descriptor_channels or width, n_classes, dropout)
        self.regularisation = regularisation

    @property
    def n_eigenpairs(self) -> int:
        """Number of eigenpairs that the diffusion uses."""
        return self.ks

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencil that the blocks differentiate with: the gradients."""
        return {"gradients": {"regularisation": self.regularisation}}

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, Q), of the input descriptor `x`, shape (N, P)."""
        basis, gradient = surface.basis.first(self.ks), Gradient(surface)
        x = self.lift(x)
        for block in self.blocks:
            x = block(x, basis, gradient)
        y: Tensor = self.embed(x)
        return y


class Gradient:
    """The stencil "gradients" of a surface as a map from functions to both components of their gradients."""

    def __init__(self, surface: Surface) -> None:
        stencil = surface.stencil("gradients")
        indptr, indices, mirror = stencil["indptr"], stencil["indices"], stencil["mirror"]
        self.components = [Csr(indptr, indices, values) for values in stencil["values"]]
        self.transposed = [Csr(indptr, indices, values[mirror]) for values in stencil["values"]]

    def __call__(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the components, shape (N, C) each, of the gradients of the functions `x`, shape (N, C)."""
        gx, gy = (spmm(matrix, x, back) for matrix, back in zip(self.components, self.transposed, strict=True))
        return gx, gy
