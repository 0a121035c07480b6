"""The input descriptor as it is: what a learned descriptor is compared with."""

from __future__ import annotations

from torch import Tensor, nn

from csm.networks.surface import Surface


class Identity(nn.Module):
    """Hand the input descriptor on.

    Its classifier can be trained, which makes a linear probe of the descriptor; matching by the nearest descriptor
    needs no training, so rows of experiments set ``trainer.max_epochs=0``.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    dropout
        Between descriptor and classifier.
    """

    def __init__(self, in_channels: int, n_classes: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.dropout = nn.Dropout(dropout)
        self.classifier = nn.Linear(in_channels, n_classes)

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the features `x`, (N, P), themselves."""
        return x

    def forward(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the logits over the template vertices, shape (N, n_classes)."""
        y: Tensor = self.classifier(self.dropout(x))
        return y
