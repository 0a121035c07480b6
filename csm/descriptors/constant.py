"""A descriptor that tells nothing."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from csm.descriptors.base import Features, as_operators
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Constant:
    """One column of ones: the input of networks that see the shape by themselves, such as `csm.networks.SplineCNN`."""

    name: ClassVar[str] = "constant"

    def __call__(self, shape: Mesh | Operators) -> Features:
        """Return 1 for every vertex, (N, 1)."""
        return Features(np.ones((as_operators(shape).mesh.n_vertices, 1)), ("one",))

    def parameters(self) -> dict[str, Any]:
        """Return every parameter as plain data; there is none."""
        return asdict(self)
