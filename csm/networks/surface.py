"""Surface: what a network knows of a shape, apart from the descriptor of its vertices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from csm.networks.basis import Basis

ON_HOST = ("extents", "row_ends", "column_ends", "offsets", "starts", "used")
"""Tensors of stencils that tell how others are cut: they stay on the host, as to read them there means to wait."""


class Surface(NamedTuple):
    """The eigenbasis of one shape, and the stencils that a network asked for.

    `stencils` has, for the name of each stencil, its tensors by name; `csm.operators.stencils` documents them and their
    shapes.
    """

    basis: Basis
    stencils: Mapping[str, Mapping[str, Tensor]] = {}

    @property
    def n_vertices(self) -> int:
        """Number N of vertices."""
        return self.basis.mass.shape[0]

    def stencil(self, name: str) -> Mapping[str, Tensor]:
        """Return the tensors of one stencil.

        Raises
        ------
        ValueError
            If the shape was prepared without this stencil.
        """
        if name not in self.stencils:
            raise ValueError(f"the network wants the stencil {name!r}, and the shape was prepared without it")
        return self.stencils[name]

    def to(self, device: torch.device | str) -> Surface:
        """Return a copy on another device; a graphics card is not waited for."""
        free = torch.device(device).type != "cpu"  # what is copied to the host has to be there when it is used

        def moved(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
            return {key: t if key in ON_HOST else t.to(device, non_blocking=free) for key, t in tensors.items()}

        basis = Basis(*(tensor.to(device, non_blocking=free) for tensor in self.basis))
        return Surface(basis, {name: moved(tensors) for name, tensors in self.stencils.items()})


def with_cuts(stencils: Mapping[str, Mapping[str, Tensor]]) -> dict[str, Mapping[str, Tensor]]:
    """Return stencils, on the host, with what networks would otherwise count on the device in every step."""
    found = dict(stencils)
    if "wavelets" in found:
        found["wavelets"] = {**found["wavelets"], "used": found["wavelets"]["responses"].count_nonzero(0)}
    if "edge_splines" in found:
        splines = found["edge_splines"]
        found["edge_splines"] = {**splines, "starts": splines["indptr"][splines["offsets"]]}
    return found
