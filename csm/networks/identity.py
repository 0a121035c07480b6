"""Identity: the input descriptor as it is, for comparison with learned descriptors."""

from __future__ import annotations

from torch import Tensor

from csm.networks.base import CorrespondenceNetwork
from csm.networks.surface import Surface


class Identity(CorrespondenceNetwork):
    """A network whose learned descriptor is the input descriptor itself.

    Training fits the classifier alone, which then tells what can be read from the input descriptor linearly.  Matching
    by the nearest descriptor needs no training, so experiments with this network set ``trainer.max_epochs=0``.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    dropout
        Dropout between the learned descriptor and the classifier.
    """

    def __init__(self, in_channels: int, n_classes: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.add_classifier(in_channels, n_classes, dropout)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the input descriptor `x`, shape (N, P), itself."""
        return x
