"""Surface: what a network knows of a shape, apart from the descriptor of its vertices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from csm.networks.basis import Basis


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
        """Return a copy on another device."""
        return Surface(
            Basis(*(tensor.to(device) for tensor in self.basis)),
            {name: {key: t.to(device) for key, t in tensors.items()} for name, tensors in self.stencils.items()},
        )
