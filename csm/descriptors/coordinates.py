"""Vertex positions as a descriptor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from csm.descriptors.base import Descriptor, Features
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Coordinates(Descriptor):
    """Coordinates of every vertex relative to the centre of the surface: an input for networks.

    Not unchanged by rotations and not a descriptor to match by: shapes must stand upright and look the same way, or
    the network must have seen them turned.

    Notes
    -----
    The centre is the mean over the surface, not over the vertices, so that it does not follow the sampling.
    """

    name: ClassVar[str] = "xyz"
    turns: ClassVar[bool] = True

    def evaluate(self, operators: Operators) -> Features:
        """Return x, y and z of every vertex, (N, 3), in units of the square root of the area if that is 1."""
        vertices, areas = operators.mesh.vertices, operators.mass
        return Features(vertices - areas @ vertices / areas.sum(), ("x", "y", "z"))
