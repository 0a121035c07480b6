"""The line field of principal curvature directions: one tangent frame per triangle.

Curvature is estimated from the dihedral angles of the edges (the normal-cycle tensor of Cohen-Steiner and Morvan,
SoCG 2003).  Two kinds of frame smooth it over the 1-ring, as the published ACD code does, and read it off in the plane
of every face: `"line_field"` averages lines, because a principal direction has no sign; `"released"` averages vectors
as that code does.  `"smooth"` is csm's own: a line field on the surface, smoothed over a length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from scipy import sparse

from csm._types import ComplexArray, FloatArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.mesh.topology import directed_edges
from csm.operators._edges import FaceBasis, dot, interior_edges, longest_edge_basis, unit
from csm.operators.linefield import smooth_line_field

FrameKind: TypeAlias = Literal["line_field", "smooth", "released"]

_FLAT = 1e-9  # tensors below this (radians, edge lengths relative to the mean) are rounding, not curvature
_UMBILIC = 1e-7  # principal curvatures closer than this, relative to the tensor, have no directions


@dataclass(frozen=True, eq=False)
class FaceFrames:
    """One orthonormal tangent pair per face; (u, v, outward normal) is right-handed.

    Attributes
    ----------
    u
        Shape (M, 3), direction of least curvature (U_min): along a limb or the axis of a cylinder.
    v
        Shape (M, 3), direction of greatest curvature (U_max): around a limb.  "Least" and "greatest" are signed, and
        positive is convex.  The sign of the pair is meaningless, and so is that of every quantity linear in it.
    coherence
        Shape (M,), from 0 (the three corners disagree, or the face is flat or umbilic: the frame then follows the
        face's longest edge) to 1 (they agree).  Of the three lines, the difference of the eigenvalues of the sum of
        u u^T over their sum; of the released vectors, the length of their mean; of the smooth field, how far the
        curvature lines within the smoothing length agree.

    Notes
    -----
    On a face without area `v` follows the longest edge and `u` is zero.
    """

    u: FloatArray
    v: FloatArray
    coherence: FloatArray


def face_frames(mesh: Mesh, *, frame: FrameKind = "line_field", sweeps: int = 3, smoothing: float = 0.08) -> FaceFrames:
    """Return the principal frame of every face.

    Parameters
    ----------
    mesh
        Consistently oriented triangle mesh; boundaries are fine.
    frame
        ``"line_field"``: at each corner of a face, the principal line of that vertex's tensor within the face plane;
        the three lines are averaged without sign (leading eigenvector of the sum of u u^T).  Unchanged by rigid
        motions and scale.  ``"smooth"``: `csm.operators.linefield.smooth_line_field`, whose smoothing does not
        depend on the resolution; unchanged by rigid motions and scale too.  ``"released"``: the authors' average of
        three signed eigenvectors, whose signs LAPACK chooses; it depends on the world axes and exists to reproduce
        published numbers.
    sweeps
        Number of smoothing sweeps over the 1-ring (10 in the released code), for the frames other than "smooth".
    smoothing
        Smoothing length of the "smooth" frame, in units of the square root of the surface area.

    Raises
    ------
    ConfigError
        If `frame` is unknown, or `sweeps` or `smoothing` is negative.

    Notes
    -----
    Where no direction exists (plane, sphere) the answer is the longest edge of the face, the first of equally long
    ones in the order of the face's corners: unchanged by rigid motions and by a new numbering of the vertices, but
    not by writing the corners of a face in another cyclic order.
    """
    if frame not in get_args(FrameKind):
        raise ConfigError(f"frame is {frame!r}, wanted one of {', '.join(get_args(FrameKind))}")
    if sweeps < 0:
        raise ConfigError(f"sweeps is {sweeps}, wanted 0 or more")
    if frame == "smooth":
        return _from_angles(longest_edge_basis(mesh), smooth_line_field(mesh, smoothing))
    tensors = smooth(mesh, edge_tensors(mesh), sweeps)
    return _line_field(mesh, tensors) if frame == "line_field" else _released(mesh, tensors)


def edge_tensors(mesh: Mesh) -> FloatArray:
    """Return the curvature tensor of every vertex, shape (N, 3, 3), without unit.

    The mean over the interior edges at the vertex of (relative length) x (signed dihedral angle) x t t^T, where t is
    the unit edge and convex angles are positive.  Its large eigenvalue lies *along* a crease, so its eigenvectors are
    the principal directions with their roles exchanged.
    """
    edges = interior_edges(mesh)
    length, tangent = edges.length, edges.tangent
    weight = edges.angle * length / max(length.mean(), np.finfo(float).tiny) if len(length) else edges.angle
    contribution = (weight[:, None, None] * tangent[:, :, None] * tangent[:, None, :]).reshape(-1, 9)
    ends = np.concatenate([edges.tail, edges.head])
    incidence = sparse.csr_array(
        (np.ones(len(ends)), (ends, np.tile(np.arange(len(length)), 2))), shape=(mesh.n_vertices, len(length))
    )
    count = np.maximum(np.bincount(ends, minlength=mesh.n_vertices), 1)
    return ((incidence @ contribution) / count[:, None]).reshape(-1, 3, 3)


def smooth(mesh: Mesh, tensors: FloatArray, sweeps: int) -> FloatArray:
    """Replace each vertex's tensor by the plain mean over itself and its neighbours, `sweeps` times."""
    n = mesh.n_vertices
    edges = directed_edges(mesh.faces, n)
    adjacency = sparse.csr_array((np.ones(len(edges.targets)), edges), shape=(n, n))
    ring = adjacency + sparse.eye_array(n)
    mean = sparse.csr_array(sparse.diags_array(1.0 / ring.sum(axis=1)) @ ring)
    flat = tensors.reshape(n, 9)
    for _ in range(sweeps):
        flat = np.asarray(mean @ flat)
    return flat.reshape(n, 3, 3)


def _line_field(mesh: Mesh, tensors: FloatArray) -> FaceFrames:
    basis = longest_edge_basis(mesh)
    total = np.zeros(mesh.n_faces, dtype=np.complex128)
    for corner in range(3):
        total += _greatest_curvature_line(tensors[mesh.faces[:, corner]], basis.e1, basis.e2)
    return _from_angles(basis, total / 3)


def _from_angles(basis: FaceBasis, line: ComplexArray) -> FaceFrames:
    """Return the frames whose v has half the argument of `line`, (M,), in the basis of every face."""
    coherence = np.abs(line)
    undecided = (coherence < _UMBILIC) | (np.abs(basis.e2).max(axis=1) == 0)
    half = 0.5 * np.angle(np.where(undecided, 1.0, line))
    cos, sin = np.cos(half)[:, None], np.sin(half)[:, None]
    return FaceFrames(
        u=sin * basis.e1 - cos * basis.e2,
        v=cos * basis.e1 + sin * basis.e2,
        coherence=np.where(undecided, 0.0, coherence),
    )


def _greatest_curvature_line(tensors: FloatArray, e1: FloatArray, e2: FloatArray) -> ComplexArray:
    """Return exp(2i angle) from e1 to the line of the *smaller* eigenvalue, 0 where there is none."""
    t1, t2 = (np.einsum("mij,mj->mi", tensors, e) for e in (e1, e2))
    difference, mixed = dot(e1, t1) - dot(e2, t2), 2 * dot(e1, t2)
    gap = np.hypot(difference, mixed)
    defined = gap > _FLAT + _UMBILIC * np.linalg.norm(tensors, axis=(1, 2))
    scale = np.where(defined, -1.0 / np.where(defined, gap, 1.0), 0.0)
    line: ComplexArray = (difference + 1j * mixed) * scale
    return line


def _released(mesh: Mesh, tensors: FloatArray) -> FaceFrames:
    values, vectors = np.linalg.eigh(tensors)
    by_size = np.argsort(np.abs(values), axis=1, kind="stable")
    values = np.take_along_axis(values, by_size, axis=1)
    vectors = np.take_along_axis(vectors, by_size[:, None, :], axis=2)
    swap = (values[:, 1] > values[:, 2])[:, None]
    u_min = np.where(swap, vectors[:, :, 1], vectors[:, :, 2])
    u_max = np.where(swap, vectors[:, :, 2], vectors[:, :, 1])
    u_max = u_max * np.where(dot(np.cross(u_min, u_max), _vertex_normals(mesh)) < 0, -1.0, 1.0)[:, None]
    mean = u_max[mesh.faces].mean(axis=1)
    normal = unit(mesh.face_crosses)
    v = unit(mean - dot(mean, normal)[:, None] * normal)
    undecided = (np.abs(v).max(axis=1) == 0) | (np.abs(normal).max(axis=1) == 0)
    v = np.where(undecided[:, None], longest_edge_basis(mesh).e1, v)
    return FaceFrames(u=np.cross(v, normal), v=v, coherence=np.linalg.norm(mean, axis=1))


def _vertex_normals(mesh: Mesh) -> FloatArray:
    total = np.zeros_like(mesh.vertices)
    np.add.at(total, mesh.faces.ravel(), np.repeat(unit(mesh.face_crosses), 3, axis=0))
    return total
