"""A constant descriptor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm.descriptors.base import Descriptor, Features, as_operators
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Constant(Descriptor):
    """One column of ones: the input of networks that get the geometry otherwise, such as `csm.networks.SplineCNN`."""

    name: ClassVar[str] = "constant"

    def __call__(self, shape: Mesh | Operators) -> Features:
        """Return 1 for every vertex, (N, 1)."""
        return Features(np.ones((as_operators(shape).mesh.n_vertices, 1)), ("one",))
