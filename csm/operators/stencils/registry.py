"""The registry of stencils, one line each.

Networks name the stencils that they need and their parameters (`csm.networks.stencils_of`); `csm.data` computes them
once per shape and keeps them in the store.
"""

from __future__ import annotations

from typing import Any

from csm.errors import ConfigError
from csm.operators.stencils.anisotropic_laplacians import AnisotropicLaplacians
from csm.operators.stencils.base import Stencil
from csm.operators.stencils.edge_splines import EdgeSplines
from csm.operators.stencils.gradients import VertexGradients
from csm.operators.stencils.polar_patches import PolarPatches
from csm.operators.stencils.scaled_laplacian import ScaledLaplacian
from csm.operators.stencils.wavelets import Wavelets

STENCILS: dict[str, type[Stencil]] = {
    "albo": AnisotropicLaplacians,
    "edge_splines": EdgeSplines,
    "gradients": VertexGradients,
    "polar_patches": PolarPatches,
    "scaled_laplacian": ScaledLaplacian,
    "wavelets": Wavelets,
}
"""The classes of stencils by `Stencil.name`."""


def stencil(name: str, **parameters: Any) -> Stencil:
    """Make a stencil from its name and parameters.

    Raises
    ------
    ConfigError
        If the name or a parameter is unknown, a parameter is missing, or a value is out of range.

    Examples
    --------
    >>> stencil("edge_splines", kernel=5)
    EdgeSplines(kernel=5)
    """
    if name not in STENCILS:
        raise ConfigError(f"there is no stencil {name!r}; known are {', '.join(sorted(STENCILS))}")
    try:
        return STENCILS[name](**parameters)
    except TypeError as error:
        raise ConfigError(f"stencil {name}: {error}") from error
