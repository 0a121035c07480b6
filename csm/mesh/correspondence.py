"""Point maps between a template and shapes, with their direction in the type, and ground truth through the template.

The direction of a map is the most common mistake with the field's files, so it is never implied:

- a `.vts` file (SGA18, FAUST_r, SHREC'19) and the `labels` of the ACD release go template -> shape, 1-based;
- label lists of other benchmarks go shape -> template, often 0-based.

In memory every map is 0-based, and -1 says that a point has no counterpart.
"""

from __future__ import annotations

import enum
import logging
from dataclasses import dataclass

import numpy as np

from csm._types import IntArray
from csm.errors import DataError

_log = logging.getLogger(__name__)


class Direction(enum.Enum):
    """Which way a `PointMap` goes; the value is what messages say."""

    TEMPLATE_TO_SHAPE = "template -> shape"
    SHAPE_TO_TEMPLATE = "shape -> template"


@dataclass(frozen=True, eq=False)
class PointMap:
    """A map between the points of a template and the vertices of one shape.

    Parameters
    ----------
    indices
        Shape (n_from,): for each point on the "from" side its counterpart on the "to" side, 0-based; -1 for none.
    direction
        Which side is the template.
    n_to
        Number of points on the "to" side.
    name
        What messages call the map: a file or a shape.
    notes
        What was decided when the map was made, such as by an inversion.

    Raises
    ------
    DataError
        If the indices are not a vector of integers in -1..n_to-1.
    """

    indices: IntArray
    direction: Direction
    n_to: int
    name: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        given = np.asarray(self.indices)
        if given.ndim != 1 or given.dtype.kind not in "iu":
            raise DataError(
                f"{self.label}: indices are {given.dtype} of shape {given.shape}, wanted a vector of integers"
            )
        indices = np.array(given, dtype=np.int64)
        outside = np.flatnonzero((indices < -1) | (indices >= self.n_to))
        if outside.size:
            raise DataError(
                f"{self.label}: point {outside[0]} goes to {indices[outside[0]]}, but a {self.direction.value} map "
                f"with {self.n_to} points on the right side holds 0..{self.n_to - 1}, or -1 for none"
            )
        indices.setflags(write=False)
        object.__setattr__(self, "indices", indices)

    @classmethod
    def identity(cls, n: int, n_to: int | None = None, name: str = "") -> PointMap:
        """Return the map that sends template point i to vertex i, for n template points and n_to >= n vertices."""
        return cls(np.arange(n), Direction.TEMPLATE_TO_SHAPE, n if n_to is None else n_to, name)

    @property
    def label(self) -> str:
        """The name, or a description of a map without one."""
        return self.name or f"{self.direction.value} map"

    @property
    def n_from(self) -> int:
        """Number of points on the "from" side."""
        return len(self.indices)

    @property
    def known(self) -> IntArray:
        """The indices without -1, in the order of the "from" side."""
        return self.indices[self.indices >= 0]

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        return f"PointMap({name}{self.direction.value}, {self.n_from} to {self.n_to} points)"

    def as_template_to_shape(self, n_template: int | None = None) -> PointMap:
        """Return this map in the direction template -> shape.

        A shape -> template map is inverted: of several vertices with one template point the first is taken, a
        template point that no vertex goes to has -1, and both counts are recorded in `notes`.

        Parameters
        ----------
        n_template
            Number of template points, if the caller knows it: a map of another template is refused.

        Raises
        ------
        DataError
            If the map is of a template with another number of points.
        """
        forward = self.direction is Direction.TEMPLATE_TO_SHAPE
        found = self.n_from if forward else self.n_to
        if n_template not in (None, found):
            raise DataError(
                f"{self.label}: this {self.direction.value} map is of a template with {found} points, wanted "
                f"{n_template}; does it go the other way, or belong to another set?"
            )
        return self if forward else self._inverted()

    def _inverted(self) -> PointMap:
        known = np.flatnonzero(self.indices >= 0)
        points, first = np.unique(self.indices[known], return_index=True)
        inverse = np.full(self.n_to, -1, dtype=np.int64)
        inverse[points] = known[first]
        note = (
            f"inverted from shape -> template: {len(known) - len(points)} vertices share a template point with an "
            f"earlier one, which was taken; {self.n_to - len(points)} template points have no vertex"
        )
        _log.info("%s: %s", self.label, note)
        return PointMap(inverse, Direction.TEMPLATE_TO_SHAPE, self.n_from, self.name, (*self.notes, note))


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Vertex pairs that correspond between two shapes, in the order of the template points.

    Parameters
    ----------
    source, target
        Shape (P,) each: vertex `source[p]` of one shape belongs to vertex `target[p]` of the other.
    """

    source: IntArray
    target: IntArray

    def __len__(self) -> int:
        return len(self.source)

    def __repr__(self) -> str:
        return f"GroundTruth({len(self)} pairs of vertices)"


def ground_truth(source: PointMap, target: PointMap) -> GroundTruth:
    """Return the pairs of two shapes that share a template point, P of them.

    Template points unknown on either shape are left out; one pair per template point, so vertices may repeat where
    a map is not one to one.

    Raises
    ------
    DataError
        If the maps are of templates with different numbers of points, or have no point in common.

    Examples
    --------
    >>> a = PointMap(np.array([4, 2, -1]), Direction.TEMPLATE_TO_SHAPE, 5)
    >>> b = PointMap(np.array([0, 1, 1]), Direction.SHAPE_TO_TEMPLATE, 3)
    >>> pairs = ground_truth(a, b)
    >>> pairs.source.tolist(), pairs.target.tolist()
    ([4, 2], [0, 1])
    """
    s, t = source.as_template_to_shape(), target.as_template_to_shape()
    if s.n_from != t.n_from:
        raise DataError(
            f"{s.label} and {t.label} are maps of templates with {s.n_from} and {t.n_from} points, so the two shapes "
            "have no common template; is one of the maps the other way round or of another set?"
        )
    both = (s.indices >= 0) & (t.indices >= 0)
    if not both.any():
        raise DataError(f"{s.label} and {t.label} have no template point in common")
    return GroundTruth(s.indices[both], t.indices[both])
