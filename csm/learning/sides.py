"""Parts of a shape that a network takes for their mirror images: found by which way their faces are turned, and mended.

A network may place a left leg where the template's right leg is.  It places it there mirrored, as the two are mirror
images of each other, so faces that looked outwards look inwards on the template.  Where they do over a whole part, and
its neighbours fit better if it is placed on the other side, left and right are exchanged in it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from scipy import sparse
from torch import Tensor
from torch.nn import functional

from csm._types import BoolArray, FloatArray
from csm.learning.places import Reading
from csm.learning.smoothing import diffusion
from csm.mesh.shape import Mesh
from csm.mesh.topology import components, edge_graph
from csm.operators.laplacian import vertex_areas

SPREAD = 0.003
"""Time of the diffusion over which turns are averaged, in units of the area: a scale of a twentieth of its root."""

LEAST = 0.03
"""Area of the least part that is exchanged, a share of the whole: that of a forearm, which looks alike all around."""

WEIGHT = 8.0
"""Of the share of the area that is turned over, against the length of the tears in units of the root of the area."""

TORN = 1.0
"""Distance of the unit rows of two neighbours from which they are torn apart."""

REACH = 0.1
"""Longest edge of a face on the template, in units of the diagonal of its bounding box, that says how it turns."""

SWEEPS = 40
"""How often the border of a part moves to where its neighbours fit, at most."""


def mended(reading: Reading, other: Callable[[], Reading], mesh: Mesh) -> Tensor:
    """Return the places of a shape, with parts that are taken for their mirror images on their own side.

    Parameters
    ----------
    reading
        Where on the template the N vertices are.
    other
        Returns where they are on the other side; called only if a part seems to belong there.
    mesh
        The shape, its faces oriented outwards; where they are not, nothing can be told, and nothing is mended.

    Returns
    -------
    Tensor
        Shape (N, K), the rows of one reading or the other.

    Examples
    --------
    >>> rows = mended(places.read(x, head), lambda: places.read(x, head, twins=True), mesh)  # doctest: +SKIP
    """
    if mesh.signed_volume < 0:
        return reading.rows
    shape = _Shape(mesh)
    turns = _turns(mesh, reading)
    turned = shape.large(shape.smooth(turns) < 0)
    if not turned:
        return reading.rows
    there = other()
    sides = _Sides(shape, (reading, there), (turns, _turns(mesh, there)))
    found = np.zeros(mesh.n_vertices, bool)
    best = sides.cost(found)
    for part in turned:
        tried = sides.settled(found ^ part)
        cost = sides.cost(tried)
        if cost < best:
            found, best = tried, cost
    return sides.rows(found)


def _turns(mesh: Mesh, reading: Reading) -> FloatArray:
    """Return for each face 1 if it keeps its orientation on the template, -1 if not, and 0 if it is torn."""
    points, normals = (part.double().cpu().numpy() for part in reading[1:])
    corners = points[mesh.faces]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    way = np.einsum("ij,ij->i", np.cross(first, second), normals[mesh.faces].mean(1))
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
    reach = REACH * np.linalg.norm(np.ptp(points, axis=0))
    signs: FloatArray = np.where(longest < reach, np.sign(way), 0.0)
    return signs


class _Shape:
    """A mesh, its edges, and the areas of its vertices."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self.areas = mesh, vertex_areas(mesh)
        self.area = float(self.areas.sum())
        graph = sparse.coo_array(edge_graph(mesh.vertices, mesh.faces))
        once = graph.row < graph.col
        self.tails, self.heads = (ends[once].astype(np.int64) for ends in (graph.row, graph.col))
        self.lengths = graph.data[once]
        self.around = sparse.csr_array((np.ones(len(graph.data), np.float32), (graph.row, graph.col)), graph.shape)

    def smooth(self, turns: FloatArray) -> FloatArray:
        """Return the mean turn around each vertex, by diffusion; 1 where no face nearby says anything."""
        corners, weights = self.mesh.faces.ravel(), np.repeat(self.mesh.face_areas, 3)
        known = np.repeat(turns, 3), np.repeat(np.abs(turns), 3)
        given = [np.bincount(corners, weights * values, self.mesh.n_vertices) for values in known]
        _, solve = diffusion(self.mesh, SPREAD)
        total, count = (solve(values) for values in given)
        enough = count > 1e-6 * count.max()
        return np.where(enough, total / np.where(enough, count, 1), 1.0)

    def large(self, chosen: BoolArray) -> list[BoolArray]:
        """Return the connected parts of chosen vertices that are large enough, the largest first."""
        if not chosen.any():
            return []
        inside = chosen[self.tails] & chosen[self.heads]
        label = components(self.tails[inside], self.heads[inside], len(chosen))
        areas = np.bincount(label[chosen], self.areas[chosen], label.max() + 1)
        enough = np.flatnonzero(areas >= LEAST * self.area)
        return [chosen & (label == i) for i in enough[np.argsort(-areas[enough])]]


class _Sides:
    """A shape on the template, each of whose vertices can be on either side."""

    def __init__(self, shape: _Shape, readings: tuple[Reading, Reading], turns: tuple[FloatArray, FloatArray]) -> None:
        self.shape, self.readings = shape, readings
        units = (functional.normalize(reading.rows, dim=1).float().cpu().numpy() for reading in self.readings)
        self.units: tuple[FloatArray, ...] = tuple(units)
        self.over = [each < 0 for each in turns]

    def rows(self, sides: BoolArray) -> Tensor:
        """Return the places of the vertices, shape (N, K); `sides` is true where they are on the other side."""
        here, there = (reading.rows for reading in self.readings)
        return torch.where(torch.from_numpy(sides).to(here.device)[:, None], there, here)

    def settled(self, sides: BoolArray) -> BoolArray:
        """Let every vertex go to the side that fits its neighbours, until none does."""
        for _ in range(SWEEPS):
            mean = np.asarray(self.shape.around @ self._units(sides))
            here, there = (np.einsum("ij,ij->i", rows, mean) for rows in self.units)
            moved = np.where(np.abs(here - there) > 1e-3 * np.abs(here), there > here, sides)
            if (moved == sides).all():
                break
            sides = moved
        return sides

    def cost(self, sides: BoolArray) -> float:
        """Return the length of the tears, and how much of the area is turned over, in one number."""
        rows, mesh = self._units(sides), self.shape.mesh
        torn = np.linalg.norm(rows[self.shape.tails] - rows[self.shape.heads], axis=1) > TORN
        side = sides[mesh.faces]  # a face with corners on both sides is torn, and turned over by neither
        over = (side.all(1) & self.over[1]) | (~side.any(1) & self.over[0])
        turned = mesh.face_areas[over].sum() / self.shape.area
        return float(self.shape.lengths[torn].sum() / np.sqrt(self.shape.area) + WEIGHT * turned)

    def _units(self, sides: BoolArray) -> FloatArray:
        chosen: FloatArray = np.where(sides[:, None], self.units[1], self.units[0])
        return chosen
