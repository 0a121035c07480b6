"""What the data modules, the preparation and the evaluation need to know of a set of shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh with what is known of its correspondence to the template of its set.

    Parameters
    ----------
    mesh
        As read from disk, not rescaled.
    truth
        Template point -> vertex of this shape.
    mirror
        The same for the left-right flipped template, where the set knows it.
    """

    mesh: Mesh
    truth: PointMap
    mirror: PointMap | None = None

    @property
    def name(self) -> str:
        """Name of the mesh."""
        return self.mesh.name


class ShapeSet(Protocol):
    """A named, ordered set of shapes over one template, read one at a time."""

    @property
    def name(self) -> str:
        """What results call this set."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, in order."""
        ...

    def load(self, name: str) -> Shape:
        """Read one shape.

        Raises
        ------
        csm.errors.DataError
            If there is no shape of that name, or its file cannot be used.
        """
        ...
