"""The base class of all stencils: arrays that single networks need of a shape besides its eigenbasis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from csm._types import Arrays
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Stencil(ABC):
    """A map from a shape to named arrays, with one row or column per vertex, edge or nonzero.

    A stencil is a frozen dataclass that derives from this class.  It has its parameters as fields, a `name`, and a
    method ``__call__``.

    Attributes
    ----------
    name
        What the networks and the store call it.
    version
        Raised by one when a change of the computation gives other arrays for the same parameters.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1

    @abstractmethod
    def __call__(self, operators: Operators) -> Arrays:
        """Compute the arrays; the mesh of `operators` is used at the scale that it has."""

    def parameters(self) -> dict[str, Any]:
        """Return the parameters as plain data and, from the second on, the version: with `name`, the key of a store."""
        return asdict(self) if self.version == 1 else {**asdict(self), "version": self.version}
