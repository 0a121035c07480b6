"""What every descriptor is: a small frozen dataclass of parameters that is called on a shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from csm._types import FloatArray
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators


@dataclass(frozen=True, eq=False)
class Features:
    """A descriptor evaluated at every vertex.

    Attributes
    ----------
    values
        Shape (N, Q).
    columns
        What each of the Q columns is, such as ``"theta=0.157 T3"``.
    """

    values: FloatArray
    columns: tuple[str, ...]


@runtime_checkable
class Descriptor(Protocol):
    """A map from a shape to one row of numbers per vertex."""

    name: ClassVar[str]

    def __call__(self, shape: Mesh | Operators) -> Features:
        """Evaluate on a mesh (which is first scaled to unit area) or on operators made before (used as they are)."""
        ...

    def parameters(self) -> dict[str, Any]:
        """Return every parameter as plain data: with `name`, all that a cache key needs."""
        ...


def record(descriptor: Descriptor) -> dict[str, Any]:
    """Return family and parameters as plain data, which `csm.descriptors.from_parameters` takes back."""
    return {"name": descriptor.name, **descriptor.parameters()}


def eigenpairs(descriptor: Descriptor) -> int:
    """Return the greatest number of eigenpairs that a descriptor asks an operator for; 0 if it asks for none.

    It is the descriptor's `eigenpairs` if it has such a property, else its parameter `k`.  Of several descriptors of
    one shape the one that asks for most goes first, because a larger spectrum serves the smaller wishes.
    """
    return int(getattr(descriptor, "eigenpairs", getattr(descriptor, "k", 0)))


def as_operators(shape: Mesh | Operators) -> Operators:
    """Return `shape` itself if it is `Operators`, else the operators of the mesh at unit area."""
    return Operators(shape) if isinstance(shape, Mesh) else shape
