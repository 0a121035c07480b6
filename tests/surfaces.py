"""Surfaces for tests of networks: what the data modules would hand over, in double precision."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from csm.mesh.shape import Mesh
from csm.networks import Basis, Surface
from csm.operators.operators import Operators
from csm.operators.stencils import stencil


def surface_of(mesh: Mesh, k: int, stencils: Mapping[str, Mapping[str, Any]] | None = None) -> Surface:
    """Return the first k eigenpairs of a mesh and the stencils with these names and parameters."""
    operators = Operators(mesh)
    spectrum = operators.lbo(k)
    basis = Basis(*(torch.as_tensor(np.array(a)) for a in (spectrum.evals, spectrum.evecs, spectrum.mass)))
    made = {name: stencil(name, **parameters)(operators) for name, parameters in (stencils or {}).items()}
    return Surface(
        basis, {name: {key: torch.as_tensor(np.array(a)) for key, a in arrays.items()} for name, arrays in made.items()}
    )
