"""Networks that turn input descriptors into learned ones; plain PyTorch.

Every network has ``describe(x, basis) -> (N, Q)``, a linear ``classifier`` over the template vertices, a ``dropout``
between the two, and ``forward(x, basis) -> (N, n_classes)``.
"""

from __future__ import annotations

from typing import Any, Protocol

from torch import Tensor, nn

from csm.networks.basis import Basis
from csm.networks.csmcnn import CSMCNN
from csm.networks.csmconv import CSMConv

__all__ = ["CSMCNN", "NETWORKS", "Basis", "CSMConv", "CorrespondenceNetwork", "build"]


class CorrespondenceNetwork(Protocol):
    """What learning and matching need of a network."""

    classifier: nn.Linear
    dropout: nn.Dropout

    def describe(self, x: Tensor, basis: Basis) -> Tensor:
        """Return the learned descriptor, shape (N, Q)."""
        ...


NETWORKS: dict[str, type[nn.Module]] = {"csmcnn": CSMCNN}


def build(name: str, in_channels: int, n_classes: int, **options: Any) -> nn.Module:
    """Make a network by name.

    Raises
    ------
    ValueError
        If the name or an option is unknown, with the names that are known.
    """
    if name not in NETWORKS:
        raise ValueError(f"there is no network {name!r}; known are {', '.join(sorted(NETWORKS))}")
    try:
        return NETWORKS[name](in_channels, n_classes, **options)
    except TypeError as error:
        raise ValueError(f"network {name}: {error}") from error
