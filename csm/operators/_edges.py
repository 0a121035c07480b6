"""Interior edges of a triangle mesh with their dihedral angles: where a polyhedron keeps its curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._types import FloatArray, IntArray
from csm.mesh.shape import Mesh
from csm.mesh.topology import edge_keys, half_edges


@dataclass(frozen=True, eq=False)
class InteriorEdges:
    """The E edges that have exactly two faces.

    Attributes
    ----------
    tail, head
        Shape (E,): vertices; the face `left` runs from tail to head, the face `right` back.
    left, right
        Shape (E,): faces.
    tangent
        Shape (E, 3): unit vector from tail to head (zero for an edge without length).
    length
        Shape (E,).
    angle
        Shape (E,), in (-pi, pi]: signed dihedral angle, positive where the surface is convex.
    """

    tail: IntArray
    head: IntArray
    left: IntArray
    right: IntArray
    tangent: FloatArray
    length: FloatArray
    angle: FloatArray


def interior_edges(mesh: Mesh) -> InteriorEdges:
    """Return the interior edges of a consistently oriented mesh."""
    tail, head = half_edges(mesh.faces)
    key = edge_keys(tail, head, mesh.n_vertices)
    order = np.argsort(key, kind="stable")
    _, start, count = np.unique(key[order], return_index=True, return_counts=True)
    first, second = order[start[count == 2]], order[start[count == 2] + 1]
    span = mesh.vertices[head[first]] - mesh.vertices[tail[first]]
    tangent = unit(span)
    normals = unit(mesh.face_crosses)
    left, right = normals[first // 3], normals[second // 3]
    return InteriorEdges(
        tail=tail[first],
        head=head[first],
        left=first // 3,
        right=second // 3,
        tangent=tangent,
        length=np.linalg.norm(span, axis=1),
        angle=np.arctan2(dot(np.cross(left, right), tangent), dot(left, right)),
    )


@dataclass(frozen=True, eq=False)
class FaceBasis:
    """An orthonormal basis in the plane of every face.

    Attributes
    ----------
    e1
        Shape (M, 3): along the face's longest edge, the first of equally long ones in the order of its corners.
    e2
        Shape (M, 3): (e1, e2, outward normal) is right-handed; zero on a face without area.
    """

    e1: FloatArray
    e2: FloatArray


def longest_edge_basis(mesh: Mesh) -> FaceBasis:
    """Return the basis of every face that its longest edge gives."""
    edges = mesh.corners[:, [1, 2, 0]] - mesh.corners
    lengths = np.linalg.norm(edges, axis=2)
    first_longest = np.argmax(lengths >= lengths.max(axis=1, keepdims=True) * (1 - 1e-6), axis=1)
    e1 = unit(edges[np.arange(mesh.n_faces), first_longest])
    return FaceBasis(e1=e1, e2=np.cross(unit(mesh.face_crosses), e1))


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the inner product of each row of `a` with that of `b`, shape (E,)."""
    product: FloatArray = np.einsum("ij,ij->i", a, b)
    return product


def unit(vectors: FloatArray) -> FloatArray:
    """Return the rows at length 1; rows of zeros stay."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
