"""Stencils: what single networks want to know of a shape besides its eigenbasis, one file each."""

from csm.operators.stencils.registry import STENCILS, Stencil, stencil

__all__ = ["STENCILS", "Stencil", "stencil"]
