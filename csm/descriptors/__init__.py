"""Descriptors: call one on a `Mesh` and get a row of numbers per vertex.

Examples
--------
>>> preset("acd_paper", angles=8).columns[:2]
('theta=0.000 T0', 'theta=0.000 T1')
"""

from csm.descriptors.base import Descriptor, Features
from csm.descriptors.chebyshev import ACD
from csm.descriptors.heat import HKS
from csm.descriptors.presets import PRESETS, from_parameters, preset
from csm.descriptors.wave import WKS

__all__ = ["ACD", "HKS", "PRESETS", "WKS", "Descriptor", "Features", "from_parameters", "preset"]
