"""A constant descriptor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm.descriptors.base import Descriptor, Features
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Constant(Descriptor):
    """One column of ones: the input of networks that get the geometry otherwise, such as `csm.networks.SplineCNN`."""

    name: ClassVar[str] = "constant"

    def evaluate(self, operators: Operators) -> Features:
        """Return 1 for every vertex, (N, 1)."""
        return Features(np.ones((operators.mesh.n_vertices, 1)), ("one",))
