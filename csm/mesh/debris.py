"""Which part of a mesh is the shape: the components with area, without the debris that scans and exports leave.

Every component has a Laplace eigenvalue zero of its own, and on a tiny one the eigenfunction is huge.  A few specks
therefore take the place of eigenfunctions of the shape; so spectra are computed on the body alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._counts import counted
from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.shape import Mesh
from csm.mesh.topology import components, half_edges

DEBRIS = 0.01
"""A component with less than this fraction of the surface area is debris, unless too much is (`TOGETHER`)."""

TOGETHER = 0.02
"""Fraction of the area that debris has together at most: many small parts are no debris but the shape."""


@dataclass(frozen=True, eq=False)
class Body:
    """The vertices and faces of the components that matter.

    Parameters
    ----------
    vertices
        Shape (N,): whether the vertex belongs to it; never so for vertices in no face.
    faces
        Shape (M,): whether the face does.
    n_components
        How many components it has.
    n_debris
        How many components are left out.
    area
        Its area, in squared units of the mesh.
    area_left_out
        Fraction of the whole area that is left out.
    """

    vertices: BoolArray
    faces: BoolArray
    n_components: int
    n_debris: int
    area: float
    area_left_out: float

    @property
    def is_all(self) -> bool:
        """Whether nothing is left out."""
        return bool(self.vertices.all())

    @property
    def note(self) -> str:
        """One phrase on what is left out; empty for nothing."""
        if self.is_all:
            return ""
        n_out = int((~self.vertices).sum())
        if self.n_debris == 0:
            return counted(n_out, "vertex in no face takes no part", "vertices in no face take no part")
        part = counted(n_out, "vertex takes no part", "vertices take no part")
        return (
            f"{part}: debris, {counted(self.n_debris, 'component')} of less than {DEBRIS:.0%} of the area "
            f"each, together {self.area_left_out:.2%}"
        )


def component_areas(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """Return the component of each vertex, (N,), and the area of each component, in squared units of the mesh.

    A vertex in no face is a component of its own, with area zero.
    """
    label = components(*half_edges(mesh.faces), mesh.n_vertices)
    if mesh.n_faces == 0:
        return label, np.zeros(label.max(initial=-1) + 1)
    areas = np.bincount(label[mesh.faces[:, 0]], mesh.face_areas, minlength=int(label.max()) + 1)
    return label, areas.astype(np.float64)


def unit_area(mesh: Mesh) -> Mesh:
    """Return a mesh scaled about the origin so that its body, all of it but the debris, has an area of 1."""
    body = body_of(mesh)
    return mesh.unit_area(None if body.n_debris == 0 else body.area)


def body_of(mesh: Mesh, debris: float = DEBRIS, together: float = TOGETHER) -> Body:
    """Return the components of a mesh that have at least the fraction `debris` of its area; the largest always counts.

    What is left out, the smallest components first, has at most the fraction `together` of the area.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> speck = Mesh(np.vstack([corners, 0.01 * corners]), np.array([[0, 1, 2], [3, 4, 5]]))
    >>> body_of(speck).vertices
    array([ True,  True,  True, False, False, False])
    """
    label, areas = component_areas(mesh)
    total = float(areas.sum())
    used = np.zeros(len(areas), dtype=bool)
    used[label[mesh.faces[:, 0]]] = True
    has_area = np.isfinite(total) and total > 0
    kept = used & ~_small(areas, debris * total, together * total) if has_area else used
    vertices: BoolArray = kept[label]
    faces: BoolArray = kept[label[mesh.faces[:, 0]]]
    area = float(areas[kept].sum())
    left_out = 1 - area / total if total > 0 else 0.0
    return Body(vertices, faces, int(kept.sum()), int((used & ~kept).sum()), area, max(left_out, 0.0))


def _small(areas: FloatArray, least: float, most_together: float) -> BoolArray:
    """Return the least areas, each below `least` and together at most `most_together`; like ones stay together."""
    ordered = np.sort(areas)
    sums = np.cumsum(ordered)[np.searchsorted(ordered, 1.001 * areas, side="right") - 1]
    small: BoolArray = (areas < least) & (areas < ordered[-1]) & (sums <= most_together)
    return small
