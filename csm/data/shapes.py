"""Shapes with known correspondence, and sets of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from csm.errors import DataError
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


def templates_of(shapes: ShapeSet) -> dict[str, str]:
    """Return name -> template of the shapes with known correspondence; a set that has no `templates` has one for all.

    Examples
    --------
    >>> templates_of(InMemory([]))
    {}
    """
    found: Mapping[str, str] = getattr(shapes, "templates", dict.fromkeys(shapes.names, ""))
    return dict(found)


class InMemory:
    """A set of shapes that are in memory already.

    Parameters
    ----------
    shapes
        The shapes; their names differ.
    name
        What results call the set.

    Raises
    ------
    DataError
        If two shapes have one name.
    """

    def __init__(self, shapes: Sequence[Shape] | Mapping[str, Shape], name: str = "shapes") -> None:
        self.name = name
        self._shapes = dict(shapes) if isinstance(shapes, Mapping) else {shape.name: shape for shape in shapes}
        if len(self._shapes) != len(shapes):
            raise DataError(
                f"{len(shapes)} shapes have only {len(self._shapes)} different names; each needs a name of its own"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, in order."""
        return tuple(self._shapes)

    def load(self, name: str) -> Shape:
        """Return one shape; DataError if there is none of that name."""
        if name not in self._shapes:
            raise DataError(f"{self.name}: there is no shape {name!r}; there are {', '.join(self.names)}")
        return self._shapes[name]
