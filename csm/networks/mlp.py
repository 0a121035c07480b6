"""MLP: a perceptron at every vertex, which shows what the input descriptor is worth without a neighbourhood."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from torch import Tensor, nn

from csm.networks.base import CorrespondenceNetwork
from csm.networks.csmcnn import Activation, Finishing, Normalisation, finishing
from csm.networks.surface import Surface


class MLP(CorrespondenceNetwork):
    """Linear layers, each followed by a normalisation and an activation, and the classifier.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    widths
        Width of each layer; the output of the last one is the learned descriptor.  The default is `CSMCNN` without its
        convolutions.
    normalisation, momentum, eps, activation
        What every layer is followed by, as in `CSMCNN`.
    dropout
        Dropout between the learned descriptor and the classifier.
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
        self.add_classifier(widths[-1], n_classes, dropout)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, Q), of the input `x`, shape (N, P); of the surface, areas count."""
        for layer in self.layers:
            x = layer(x, surface.basis.mass) if isinstance(layer, Finishing) else layer(x)
        return x
