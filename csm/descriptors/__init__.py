"""Descriptors: call one on a `Mesh` and get a row of numbers per vertex."""

from csm.descriptors.base import Descriptor, Features
from csm.descriptors.chebyshev import ACD

__all__ = ["ACD", "Descriptor", "Features"]
