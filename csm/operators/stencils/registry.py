"""Stencils: what networks that are not purely spectral want to know of a shape, as plain arrays.

A stencil is a small frozen dataclass of parameters, called on the operators of a shape.  Networks name the ones they
want (`csm.networks.stencils_of`); `csm.data` computes them once per shape and keeps them in the store.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

from csm._types import Arrays
from csm.operators.operators import Operators
from csm.operators.stencils.anisotropic_laplacians import AnisotropicLaplacians
from csm.operators.stencils.edge_splines import EdgeSplines
from csm.operators.stencils.gradients import VertexGradients
from csm.operators.stencils.scaled_laplacian import ScaledLaplacian
from csm.operators.stencils.wavelets import Wavelets


class Stencil(Protocol):
    """A map from a shape to named arrays, with one row or column per vertex, edge or nonzero."""

    name: ClassVar[str]

    def __call__(self, operators: Operators) -> Arrays:
        """Compute the arrays; the mesh of `operators` is used at the scale that it has."""
        ...

    def parameters(self) -> dict[str, Any]:
        """Return every parameter as plain data: with `name`, all that a cache key needs."""
        ...


STENCILS: dict[str, type[Stencil]] = {
    AnisotropicLaplacians.name: AnisotropicLaplacians,
    EdgeSplines.name: EdgeSplines,
    ScaledLaplacian.name: ScaledLaplacian,
    VertexGradients.name: VertexGradients,
    Wavelets.name: Wavelets,
}


def stencil(name: str, **parameters: Any) -> Stencil:
    """Make a stencil from its name and parameters.

    Raises
    ------
    ValueError
        If the name or a parameter is unknown, with the names that are known.
    """
    if name not in STENCILS:
        raise ValueError(f"there is no stencil {name!r}; known are {', '.join(sorted(STENCILS))}")
    try:
        return STENCILS[name](**parameters)
    except TypeError as error:
        raise ValueError(f"stencil {name}: {error}") from error
