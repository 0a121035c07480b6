"""Which way round a map goes: pseudo-scalars that a mirrored map turns into their negatives.

The left-right reflection of a body is nearly an isometry, so Laplacians and their spectra cannot tell a map from its
mirror image.  The orientation of the surfaces can: n . (grad f x grad g) of two functions, with the outward normal n,
is kept by a map that keeps orientation, and changes its sign under one that does not (Ren et al. 2018, section 3).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from csm._types import FloatArray
from csm.mesh.shape import Mesh
from csm.operators.spectrum import Spectrum


def cross_gradients(mesh: Mesh, f: FloatArray, g: FloatArray) -> FloatArray:
    """Return n . (grad f_i x grad g_j) at the vertices, for functions that are linear on each face.

    Parameters
    ----------
    mesh
        N vertices, M faces, oriented outwards.
    f, g
        Shapes (N, I) and (N, J).

    Returns
    -------
    FloatArray
        Shape (N, I, J), the mean over the faces around each vertex, weighted by area; 0 where a vertex has no area.
        Its unit is that of f times that of g over the square of the mesh's unit of length.

    Examples
    --------
    >>> mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), "one face in the plane")
    >>> cross_gradients(mesh, mesh.vertices[:, :1], mesh.vertices[:, 1:2])[:, 0, 0]
    array([1., 1., 1.])
    """
    faces = mesh.faces
    (f1, f2), (g1, g2) = ([x[faces[:, c]] - x[faces[:, 0]] for c in (1, 2)] for x in (f, g))
    # On a face, grad f x grad g is (f1 g2 - f2 g1) / (2 area) along the normal: times the area it has no division.
    total = 0.5 * (f1[:, :, None] * g2[:, None, :] - f2[:, :, None] * g1[:, None, :])
    around = _gather(mesh, mesh.face_areas[:, None])
    summed = _gather(mesh, total.reshape(len(faces), -1))
    values: FloatArray = np.divide(summed, around, out=np.zeros_like(summed), where=around > 0)
    return values.reshape(mesh.n_vertices, f.shape[1], g.shape[1])


def spectral_turns(mesh: Mesh, spectrum: Spectrum, k: int, smooth: int) -> FloatArray:
    """Return n . (grad phi_i x grad phi_j) of the first `k` eigenfunctions, without frequencies above `smooth` of them.

    Parameters
    ----------
    mesh
        N vertices, at the scale of the spectrum.
    spectrum
        Its Laplace-Beltrami eigenpairs.
    k
        How many functions are crossed with each other.
    smooth
        How many eigenfunctions the results are projected on.

    Returns
    -------
    FloatArray
        Shape (N, k, k), antisymmetric in the last two.
    """
    low, wide = spectrum.first(k).evecs, spectrum.first(smooth)
    upper = np.triu_indices(k, 1)
    values = cross_gradients(mesh, low, low)[:, upper[0], upper[1]]
    values = wide.evecs @ (wide.evecs.T @ (wide.mass[:, None] * values))
    turns = np.zeros((len(values), k, k))
    turns[:, upper[0], upper[1]] = values
    return turns - turns.transpose(0, 2, 1)


def _gather(mesh: Mesh, of_faces: FloatArray) -> FloatArray:
    """Sum values of faces, (M, C), at their vertices, (N, C)."""
    corners = mesh.faces.ravel()
    faces = np.repeat(np.arange(mesh.n_faces), 3)
    incidence = sparse.csr_array((np.ones(len(corners)), (corners, faces)), shape=(mesh.n_vertices, mesh.n_faces))
    gathered: FloatArray = np.asarray(incidence @ of_faces)
    return gathered
