"""A perceptron on every vertex by itself: what the input descriptor is worth without a neighbourhood."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from torch import Tensor, nn

from csm.networks.csmcnn import Activation, Normalisation, finishing
from csm.networks.surface import Surface


class MLP(nn.Module):
    """Linear layers, each with normalisation and activation, and a classifier over the template vertices.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    widths
        Of the layers; the last one's output is the learned descriptor.  The default is `CSMCNN` without its
        convolutions.
    normalisation, momentum, eps, activation
        As of `CSMCNN`, after every layer.
    dropout
        Between descriptor and classifier.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        widths: Sequence[int] = (64, 256),
        normalisation: Normalisation = "batch",
        momentum: float = 0.1,
        eps: float = 1e-5,
        dropout: float = 0.5,
        activation: Activation = "relu",
    ) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, width in itertools.pairwise((in_channels, *widths)):
            layers += [nn.Linear(before, width), finishing(width, normalisation, activation, momentum, eps)]
        self.layers = nn.Sequential(*layers)
        self.dropout = nn.Dropout(dropout)
        self.classifier = nn.Linear(widths[-1], n_classes)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, (N, widths[-1]), of features `x`, (N, P); the surface plays no part."""
        y: Tensor = self.layers(x)
        return y

    def forward(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the logits over the template vertices, shape (N, n_classes)."""
        y: Tensor = self.classifier(self.dropout(self.describe(x, surface)))
        return y
