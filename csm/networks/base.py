"""What every network has in common, and the sequence of layers that the convolutional networks share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from csm.networks.surface import Surface


class CorrespondenceNetwork(nn.Module, ABC):
    """A network that turns the input descriptor of a shape into a learned descriptor and classifies it.

    The learned descriptor, of Q channels per vertex, is what shapes are matched by.  In training, a linear classifier
    on top of it predicts, for every vertex of the shape, the corresponding vertex of the template.

    A subclass implements `describe`.  Its constructor takes the number of input channels, the number of template
    vertices and its options, all of which have defaults, and ends with a call of `add_classifier`.  It only creates
    layers, so that a network can also be created on PyTorch's "meta" device in order to be asked for its stencils.

    Attributes
    ----------
    dropout
        It is applied between the learned descriptor and the classifier.
    classifier
        The linear layer from Q channels to the template vertices.
    """

    dropout: nn.Dropout
    classifier: nn.Linear

    def add_classifier(self, descriptor_channels: int, n_classes: int, dropout: float) -> None:
        """Create the dropout and the classifier; the constructor of every network ends with this.

        Parameters
        ----------
        descriptor_channels
            Number Q of channels of the learned descriptor.
        n_classes
            Number of template vertices.
        dropout
            Probability with which training sets an entry of the learned descriptor to zero.
        """
        self.dropout = nn.Dropout(dropout)
        self.classifier = nn.Linear(descriptor_channels, n_classes)

    @property
    def n_eigenpairs(self) -> int:
        """Number of Laplace-Beltrami eigenpairs that the network takes from the basis of a surface; 0 for none."""
        return 0

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencils that the network needs of a shape, from their names to their parameters.

        A stencil holds what a network needs besides the eigenbasis (`csm.operators.stencils`); most need none.
        """
        return {}

    def filters(self, evals: Tensor) -> dict[str, Tensor]:
        """Return the learned spectral filters at the eigenvalues, so that they can be plotted.

        Parameters
        ----------
        evals
            Eigenvalues, shape (K,), ascending.

        Returns
        -------
        dict[str, Tensor]
            From the name of a layer to its filters, shape (K, C_in, C_out); empty if the network learns none.
        """
        return {}

    @abstractmethod
    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, Q), of the input descriptor `x`, shape (N, P)."""

    def forward(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the logits over the template vertices, shape (N, n_classes), of the input `x`, shape (N, P)."""
        logits: Tensor = self.classifier(self.dropout(self.describe(x, surface)))
        return logits


class ConvolutionalNetwork(CorrespondenceNetwork):
    r"""L convolutions on the surface, and a linear layer whose output is the learned descriptor.

    .. math::
        x_0 = \mathrm{lift}(x), \qquad
        x_{l+1} = \sigma_l\big(\mathrm{conv}_l(x_l;\,\mathrm{operators})\big), \qquad
        y = \sigma_L(x_L W + b)

    A subclass creates `convs` and `embed` in its constructor and says with `operators` what its convolutions need of
    the surface.  It overrides `lifted` and `activated` if it has a layer before the convolutions, or follows them with
    something other than ELU.

    Attributes
    ----------
    convs
        The L convolutions.  Each is called with functions, shape (N, C_in), and the operators of the surface, and
        returns functions, shape (N, C_out).
    embed
        The linear layer from the channels of the last convolution to the Q channels of the learned descriptor.
    """

    convs: nn.ModuleList
    embed: nn.Linear

    @abstractmethod
    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the arguments that every convolution takes after the functions, which have the given dtype."""

    def lifted(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the input of the first convolution, x_0; by default this is the input descriptor, shape (N, P)."""
        return x

    def activated(self, x: Tensor, layer: int, surface: Surface) -> Tensor:
        """Return the output `x`, shape (N, C), of a layer after its activation, which is ELU by default.

        Layers 0 to L - 1 are the convolutions, and layer L is `embed`.
        """
        return functional.elu(x)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, Q), of the input descriptor `x`, shape (N, P)."""
        operators = self.operators(surface, x.dtype)
        x = self.lifted(x, surface)
        for layer, conv in enumerate(self.convs):
            x = self.activated(conv(x, *operators), layer, surface)
        return self.activated(self.embed(x), len(self.convs), surface)
