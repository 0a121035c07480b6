"""The stencil "gradients": tangential derivatives of functions at the vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm._types import Arrays, FloatArray, IntArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.mesh.topology import directed_edges
from csm.operators._edges import dot, unit
from csm.operators.operators import Operators
from csm.operators.stencils.base import Stencil

_LONGEST = 1e-6  # edges at a vertex within this fraction of the longest are equally long


@dataclass(frozen=True)
class VertexGradients(Stencil):
    r"""The gradient of a function at every vertex, as two matrices that give its components in a tangent frame.

    At vertex i the gradient is the least-squares fit to the differences along the edges ij, with p_ij the edge in the
    tangent plane:

    .. math::
        g_i = \Big(\epsilon I + \sum_j p_{ij} p_{ij}^\top\Big)^{-1} \sum_j p_{ij} (f_j - f_i)

    Parameters
    ----------
    regularisation
        epsilon, in squared units of length of the mesh, whose area is 1 in csm.  Gradients shrink by about epsilon
        over half the sum of the squared edges: 3 % at most vertices of a body of 7000, more where they are dense.

    Raises
    ------
    ConfigError
        If `regularisation` is not positive.

    Notes
    -----
    Frames are right-handed about the outward normal of `Mesh.vertex_normals`; the first axis is the longest edge at
    the vertex, which is arbitrary.  DiffusionNet's features do not depend on it, but do on the orientation.

    References
    ----------
    Sharp et al., "DiffusionNet: discretization agnostic learning on surfaces", TOG 2022, and its released code, whose
    vertex normals weight all faces alike and whose regularisation is relative to a mesh scaled to radius 1.
    """

    regularisation: float

    name: ClassVar[str] = "gradients"

    def __post_init__(self) -> None:
        if not self.regularisation > 0:
            raise ConfigError(f"{self}: wanted a regularisation above 0")

    def __call__(self, operators: Operators) -> Arrays:
        """Return the two matrices on one pattern that includes the diagonal.

        `indptr` (N + 1,) and `indices` (nnz,); `values` (2, nnz), the components; `mirror` (nnz,), where the entry
        (j, i) is, for each entry (i, j).
        """
        mesh = operators.mesh
        tail, head = directed_edges(mesh.faces, mesh.n_vertices)
        tail, head = tail[tail != head], head[tail != head]
        weights = _fit(_in_tangent_plane(mesh, tail, head), tail, mesh.n_vertices, self.regularisation)
        centre = np.stack([-np.bincount(tail, w, mesh.n_vertices) for w in weights.T], axis=1)
        vertices = np.arange(mesh.n_vertices)
        rows, columns = np.concatenate([tail, vertices]), np.concatenate([head, vertices])
        order = np.lexsort((columns, rows))
        rows, columns = rows[order], columns[order]
        return {
            "indptr": np.searchsorted(rows, np.arange(mesh.n_vertices + 1)),
            "indices": columns,
            "values": np.concatenate([weights, centre])[order].T.copy(),
            "mirror": np.lexsort((rows, columns)),
        }


def _in_tangent_plane(mesh: Mesh, tail: IntArray, head: IntArray) -> FloatArray:
    """Return the components of every edge, (E, 2), in the frame of its tail."""
    span = mesh.vertices[head] - mesh.vertices[tail]
    normals = mesh.vertex_normals
    flat = span - dot(span, normals[tail])[:, None] * normals[tail]
    length = np.linalg.norm(flat, axis=1)
    longest = np.zeros(mesh.n_vertices)
    np.maximum.at(longest, tail, length)
    candidates = np.flatnonzero(length >= (1 - _LONGEST) * longest[tail])
    first = np.zeros((mesh.n_vertices, 3))
    first[tail[candidates]] = unit(flat[candidates])
    second = np.cross(normals, first)
    return np.stack([dot(span, first[tail]), dot(span, second[tail])], axis=1)


def _fit(p: FloatArray, tail: IntArray, n: int, regularisation: float) -> FloatArray:
    """Return the weight of every edge, with components `p`, in the gradient at its tail, (E, 2)."""
    xx = np.bincount(tail, p[:, 0] ** 2, n)[tail] + regularisation
    yy = np.bincount(tail, p[:, 1] ** 2, n)[tail] + regularisation
    xy = np.bincount(tail, p[:, 0] * p[:, 1], n)[tail]
    weights = np.stack([yy * p[:, 0] - xy * p[:, 1], xx * p[:, 1] - xy * p[:, 0]], axis=1)
    fitted: FloatArray = weights / (xx * yy - xy * xy)[:, None]
    return fitted
