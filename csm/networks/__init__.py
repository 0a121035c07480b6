"""Networks that turn input descriptors into learned ones; plain PyTorch.

Every network has ``describe(x, surface) -> (N, Q)``, a linear ``classifier`` over the template vertices, a ``dropout``
between the two, and ``forward(x, surface) -> (N, n_classes)``.  One that needs more of a shape than its eigenbasis has
a static ``stencils(**options)`` that names the stencils of `csm.operators.stencils` and their parameters.
"""

from __future__ import annotations

from typing import Any, Protocol

from torch import Tensor, nn

from csm.networks.acscnn import ACSCNN, ACSConv
from csm.networks.basis import Basis
from csm.networks.chebynet import ChebyNet
from csm.networks.csmcnn import CSMCNN
from csm.networks.csmconv import CSMConv
from csm.networks.diffusionnet import DiffusionNet
from csm.networks.identity import Identity
from csm.networks.mgcn import MGCN
from csm.networks.mgconv import MGConv
from csm.networks.mlp import MLP
from csm.networks.splinecnn import SplineCNN
from csm.networks.surface import Surface

__all__ = [
    "ACSCNN",
    "CSMCNN",
    "MGCN",
    "MLP",
    "NETWORKS",
    "ACSConv",
    "Basis",
    "CSMConv",
    "ChebyNet",
    "CorrespondenceNetwork",
    "DiffusionNet",
    "Identity",
    "MGConv",
    "SplineCNN",
    "Surface",
    "build",
    "stencils_of",
]


class CorrespondenceNetwork(Protocol):
    """What learning and matching need of a network."""

    classifier: nn.Linear
    dropout: nn.Dropout

    def describe(self, x: Tensor, surface: Surface) -> Tensor:
        """Return the learned descriptor, shape (N, Q)."""
        ...


NETWORKS: dict[str, type[nn.Module]] = {
    "acscnn": ACSCNN,
    "chebynet": ChebyNet,
    "csmcnn": CSMCNN,
    "diffusionnet": DiffusionNet,
    "identity": Identity,
    "mgcn": MGCN,
    "mlp": MLP,
    "splinecnn": SplineCNN,
}


def build(name: str, in_channels: int, n_classes: int, **options: Any) -> nn.Module:
    """Make a network by name.

    Raises
    ------
    ValueError
        If the name or an option is unknown, with the names that are known.
    """
    try:
        return _known(name)(in_channels, n_classes, **options)
    except TypeError as error:
        raise ValueError(f"network {name}: {error}") from error


def stencils_of(name: str, **options: Any) -> dict[str, dict[str, Any]]:
    """Return the stencils that a network with these options wants, name -> parameters; none for most.

    Raises
    ------
    ValueError
        If the name is unknown, with the names that are known.

    Examples
    --------
    >>> stencils_of("csmcnn", ks=64)
    {}
    """
    ask = getattr(_known(name), "stencils", None)
    wanted: dict[str, dict[str, Any]] = {} if ask is None else ask(**options)
    return wanted


def _known(name: str) -> type[nn.Module]:
    if name not in NETWORKS:
        raise ValueError(f"there is no network {name!r}; known are {', '.join(sorted(NETWORKS))}")
    return NETWORKS[name]
