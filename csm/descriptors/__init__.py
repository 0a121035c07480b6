"""Descriptors: call one on a `Mesh` and get a row of numbers per vertex.

Every family that `csm.descriptors.presets` registers is here under the name of its class; those named below are known
to type checkers as well.

Examples
--------
>>> from csm.descriptors import preset
>>> preset("acd_paper", angles=8).columns[:2]
('theta=0.000 T0', 'theta=0.000 T1')
"""

from typing import TYPE_CHECKING

from csm._places import lazily
from csm.descriptors.presets import classes

if TYPE_CHECKING:
    from csm.descriptors.acd import ACD
    from csm.descriptors.add import ADD
    from csm.descriptors.amks import AMKS
    from csm.descriptors.asmwd import ASMWD
    from csm.descriptors.awft import AWFT
    from csm.descriptors.base import Descriptor, Features
    from csm.descriptors.constant import Constant
    from csm.descriptors.coordinates import Coordinates
    from csm.descriptors.dep import DEP
    from csm.descriptors.geometry_vectors import GeometryVectors
    from csm.descriptors.gps import GPS
    from csm.descriptors.hks import HKS
    from csm.descriptors.lps import LPS
    from csm.descriptors.presets import FAMILIES, PRESETS, from_parameters, preset
    from csm.descriptors.shot import SHOT
    from csm.descriptors.smwd import SMWD
    from csm.descriptors.stack import Stack
    from csm.descriptors.weds import WEDS
    from csm.descriptors.wft import WFT
    from csm.descriptors.wks import WKS

__all__ = [
    "ACD",
    "ADD",
    "AMKS",
    "ASMWD",
    "AWFT",
    "DEP",
    "FAMILIES",
    "GPS",
    "HKS",
    "LPS",
    "PRESETS",
    "SHOT",
    "SMWD",
    "WEDS",
    "WFT",
    "WKS",
    "Constant",
    "Coordinates",
    "Descriptor",
    "Features",
    "GeometryVectors",
    "Stack",
    "from_parameters",
    "preset",
]

_PLACES = {
    "csm.descriptors.base": ("Descriptor", "Features"),
    "csm.descriptors.presets": ("FAMILIES", "PRESETS", "from_parameters", "preset"),
    "csm.descriptors.stack": ("Stack",),
    **classes(),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
