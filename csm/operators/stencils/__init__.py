"""Stencils: arrays that single networks need of a shape besides its eigenbasis, one file each."""

from csm.operators.stencils.base import Stencil
from csm.operators.stencils.registry import STENCILS, stencil

__all__ = ["STENCILS", "Stencil", "stencil"]
