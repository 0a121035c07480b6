"""Networks that turn input descriptors into learned descriptors, in plain PyTorch.

`csm.networks.base` says what every network has, and `csm.networks.registry` creates networks by name.
"""

from typing import TYPE_CHECKING

from csm._places import lazily

if TYPE_CHECKING:
    from csm.networks.acscnn import ACSCNN, ACSConv
    from csm.networks.base import ConvolutionalNetwork, CorrespondenceNetwork
    from csm.networks.basis import Basis
    from csm.networks.chebynet import ChebyNet
    from csm.networks.csmcnn import CSMCNN
    from csm.networks.csmconv import CSMConv
    from csm.networks.diffusionnet import DiffusionNet
    from csm.networks.gcnn import GCNN, GeodesicConv
    from csm.networks.identity import Identity
    from csm.networks.mgcn import MGCN
    from csm.networks.mgconv import MGConv
    from csm.networks.mlp import MLP
    from csm.networks.registry import MODELS, NETWORKS, build, settings, stencils_of
    from csm.networks.splinecnn import SplineCNN
    from csm.networks.surface import Surface

__all__ = [
    "ACSCNN",
    "CSMCNN",
    "GCNN",
    "MGCN",
    "MLP",
    "MODELS",
    "NETWORKS",
    "ACSConv",
    "Basis",
    "CSMConv",
    "ChebyNet",
    "ConvolutionalNetwork",
    "CorrespondenceNetwork",
    "DiffusionNet",
    "GeodesicConv",
    "Identity",
    "MGConv",
    "SplineCNN",
    "Surface",
    "build",
    "settings",
    "stencils_of",
]

_PLACES = {
    "csm.networks.acscnn": ("ACSCNN", "ACSConv"),
    "csm.networks.base": ("ConvolutionalNetwork", "CorrespondenceNetwork"),
    "csm.networks.basis": ("Basis",),
    "csm.networks.chebynet": ("ChebyNet",),
    "csm.networks.csmcnn": ("CSMCNN",),
    "csm.networks.csmconv": ("CSMConv",),
    "csm.networks.diffusionnet": ("DiffusionNet",),
    "csm.networks.gcnn": ("GCNN", "GeodesicConv"),
    "csm.networks.identity": ("Identity",),
    "csm.networks.mgcn": ("MGCN",),
    "csm.networks.mgconv": ("MGConv",),
    "csm.networks.mlp": ("MLP",),
    "csm.networks.registry": ("MODELS", "NETWORKS", "build", "settings", "stencils_of"),
    "csm.networks.splinecnn": ("SplineCNN",),
    "csm.networks.surface": ("Surface",),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
