"""A smooth field of principal curvature lines on the faces of a mesh.

Lines have no sign and live in different planes from face to face.  A line at angle phi to a reference in its face is
the complex number exp(2i phi); across an edge two faces compare theirs by unfolding them into one plane, so that sums
and smoothing stay on the surface.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from csm._types import ComplexArray, FloatArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators._edges import InteriorEdges, dot, interior_edges, longest_edge_basis
from csm.operators._field import FieldDiffusion

CURVATURE_LENGTH = 0.01
"""Length over which curvature is first averaged, in units of sqrt(area): about one edge of a mesh of 7,000 vertices."""

_FLAT = 1e-9  # curvature below this, times sqrt(area), is rounding
_FACTORED = 50_000  # faces up to which a factorisation takes no longer
_LEAST_AREA = 1e-6  # of the mean face: slivers take their neighbours' line


def smooth_line_field(mesh: Mesh, smoothing: float) -> ComplexArray:
    r"""Return the lines of greatest curvature, smoothed over a length.

    With the curvature measure of a face in its own plane (Cohen-Steiner and Morvan, SoCG 2003)

    .. math:: q_f = \tfrac{1}{2} \sum_{e \in f} \beta_e \, |e| \, e^{2 i \phi_{e,f}}

    (beta the dihedral angle, phi the angle of the edge in the face), two steps of implicit diffusion with the
    connection Laplacian K of the dual graph, :math:`(A + \ell^2 K) z = b`: from the measure q to its density over
    `CURVATURE_LENGTH`, and, after every face's line has been given the same weight, over `smoothing`.  The second step
    is the smoothest line field aligned with curvature in the sense of Knoppel, Crane, Pinkall and Schroder (SIGGRAPH
    2013), on faces.  Equal weights keep the creases that come and go with the pose from ruling their surroundings.

    Parameters
    ----------
    mesh
        Consistently oriented triangle mesh; boundaries are fine.
    smoothing
        Length in units of sqrt(area), at least 0.

    Returns
    -------
    ComplexArray
        Shape (M,): twice the angle from the face's longest edge to the line of greatest curvature is the argument;
        the modulus runs from 0 (the lines around disagree, or there is no curvature) to 1 (they agree).

    Raises
    ------
    ConfigError
        If `smoothing` is negative.
    """
    if not smoothing >= 0:
        raise ConfigError(f"smoothing is {smoothing}, wanted a length of 0 or more, in units of sqrt(area)")
    total = mesh.area
    area = np.maximum(mesh.face_areas, _LEAST_AREA * total / mesh.n_faces)
    edges = interior_edges(mesh)
    left, right = _edge_lines(mesh, edges)
    measure = np.zeros(mesh.n_faces, dtype=np.complex128)
    np.add.at(measure, edges.left, 0.5 * edges.angle * edges.length * left)
    np.add.at(measure, edges.right, 0.5 * edges.angle * edges.length * right)
    laplacian = _connection_laplacian(edges, left * right.conj(), area)

    diffuse = _diffusion(area, laplacian)
    density = diffuse(measure, CURVATURE_LENGTH**2 * total)
    size = np.abs(density)
    curved = size * np.sqrt(total) > _FLAT
    lines = -density / np.where(curved, size, np.inf)  # the measure lies along creases, across the greatest curvature
    return diffuse(area * lines, smoothing**2 * total)


def _edge_lines(mesh: Mesh, edges: InteriorEdges) -> tuple[ComplexArray, ComplexArray]:
    """Return the line of every edge in the basis of its left and of its right face, each of shape (E,)."""
    basis = longest_edge_basis(mesh)
    left, right = (
        (dot(edges.tangent, basis.e1[face]) + 1j * dot(edges.tangent, basis.e2[face])) ** 2
        for face in (edges.left, edges.right)
    )
    return left, right


def _connection_laplacian(edges: InteriorEdges, transport: ComplexArray, area: FloatArray) -> sparse.csc_array:
    """Return the Hermitian matrix of sum_e 3 |e|^2 / (A_left + A_right) |z_left - transport z_right|^2, (M, M)."""
    i, j, n = edges.left, edges.right, len(area)
    weight = 3 * edges.length**2 / (area[i] + area[j])
    values = np.concatenate([weight, weight, -weight * transport, -weight * transport.conj()])
    rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
    return sparse.csc_array((values, (rows, columns)), shape=(n, n))


def _diffusion(area: FloatArray, laplacian: sparse.csc_array) -> Callable[[ComplexArray, float], ComplexArray]:
    """Return a function of a measure, shape (M,), and a time: the density z with (A + time K) z = measure."""
    iterative = FieldDiffusion(laplacian, area) if len(area) > _FACTORED else None

    def diffuse(measure: ComplexArray, time: float) -> ComplexArray:
        z = iterative.solve(measure, time) if iterative else None
        if z is None:
            z = splu(sparse.csc_array(sparse.diags_array(area) + time * laplacian)).solve(measure)
        return z

    return diffuse
