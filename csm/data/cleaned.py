"""Sets of shapes whose meshes are cleaned when they are read, with their maps carried over."""

from __future__ import annotations

import logging

import numpy as np

from csm.data.shapes import Shape, ShapeSet, templates_of
from csm.mesh.clean import Cleaned, clean
from csm.mesh.correspondence import PointMap

_log = logging.getLogger(__name__)


class CleanedSet:
    """A set of which every mesh is cleaned by `csm.clean` when it is read.

    Parameters
    ----------
    shapes
        The set as it is.
    """

    def __init__(self, shapes: ShapeSet) -> None:
        self.shapes = shapes
        self.name = shapes.name
        self.names = shapes.names
        self.templates = templates_of(shapes)

    def load(self, name: str) -> Shape:
        """Read one shape and clean it; raises as the set itself does."""
        return cleaned_shape(self.shapes.load(name))


def cleaned_shape(shape: Shape) -> Shape:
    """Return a shape with its mesh cleaned and its maps carried over; the same one if nothing had to be done."""
    done = clean(shape.mesh)
    if not done.mends:
        return shape
    _log.warning("%s: cleaned: %s", shape.mesh.label, done.text)
    mirror = None if shape.mirror is None else carried_map(shape.mirror, done)
    return Shape(done.mesh, carried_map(shape.truth, done), mirror)


def carried_map(points: PointMap, done: Cleaned) -> PointMap:
    """Return a map template -> old vertices as one to the new vertices; -1 where the vertex was left out."""
    new = np.where(points.indices >= 0, done.vertex_map[points.indices], -1)
    return PointMap(new, points.direction, done.mesh.n_vertices, points.name, (*points.notes, done.text))
