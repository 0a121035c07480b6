"""Finite-element Laplacians of a triangle mesh: isotropic, and anisotropic for every strength and angle at once.

Signs: every stiffness matrix here is positive semidefinite and its rows sum to zero; the mass matrix is the diagonal
of `vertex_areas` (a third of the incident triangles), so the eigenproblem reads  S phi = lambda diag(areas) phi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators.frames import FaceFrames

AREA_FLOOR = 1e-7
"""Least area, as a fraction of its longest edge squared, that a face has in a stiffness matrix."""


def vertex_areas(mesh: Mesh) -> FloatArray:
    """Return the barycentric vertex areas, shape (N,), in squared units of the mesh; they sum to its area."""
    thirds = np.repeat(mesh.face_areas / 3, 3)
    return np.bincount(mesh.faces.ravel(), thirds, minlength=mesh.n_vertices).astype(np.float64)


def degenerate_faces(mesh: Mesh) -> IntArray:
    """Return the faces thinner than `AREA_FLOOR`, which stiffness matrices take to have that area.

    Their true stiffness is (nearly) infinite.  The floor keeps it finite and still ties the three corners together.
    """
    return np.flatnonzero(mesh.face_areas < _least_areas(mesh))


def stiffness(mesh: Mesh) -> sparse.csr_array:
    """Return the cotangent stiffness, (N, N): off the diagonal -(cot a + cot b) / 2, without unit."""
    edges = _opposite_edges(mesh)
    products = np.einsum("mpi,mqi->mpq", edges, edges)
    return _Pattern.of(mesh).assemble(products)


@dataclass(frozen=True, eq=False)
class AnisotropicStiffness:
    """Three matrices, (N, N) each and of one sparsity pattern, that hold the stiffness of every strength and angle.

    With d = 1 / (1 + alpha), the conductivity in the frame turned by theta about the outward normal is d along U_max
    and 1 along U_min, which in the face's own (u, v) is a multiple of the identity plus a multiple of
    [cos 2theta, sin 2theta; sin 2theta, -cos 2theta].  Hence

        B(alpha, theta) = (1 + d)/2 b0 - (1 - d)/2 (cos 2theta bc + sin 2theta bs).
    """

    b0: sparse.csr_array
    bc: sparse.csr_array
    bs: sparse.csr_array

    def at(self, alpha: float, theta: float) -> sparse.csr_array:
        """Return the stiffness for strength `alpha` >= 0 (0 is isotropic) and angle `theta` in radians, period pi.

        Raises
        ------
        ConfigError
            If `alpha` is negative or either is not finite.
        """
        if not (np.isfinite(theta) and np.isfinite(alpha) and alpha >= 0):
            raise ConfigError(f"alpha={alpha}, theta={theta}: wanted finite numbers with alpha at least 0")
        d = 1.0 / (1.0 + alpha)
        turned = np.cos(2 * theta) * self.bc.data + np.sin(2 * theta) * self.bs.data
        data = 0.5 * (1 + d) * self.b0.data - 0.5 * (1 - d) * turned
        return sparse.csr_array((data, self.b0.indices, self.b0.indptr), shape=self.b0.shape)


def anisotropic_stiffness(mesh: Mesh, frames: FaceFrames) -> AnisotropicStiffness:
    """Return the three stiffness matrices of `mesh` for a frame per face.

    Per face, with e_p the edge opposite corner p and (x, y) its components along (u, v), the entries are
    (x x' + y y'), (x x' - y y') and (x y' + y x'), all over four areas.  An edge is the gradient of its corner's hat
    function turned by 90 degrees, which is why weighting edges along `u` by d slows heat along `v`.

    References
    ----------
    Boscaini et al., "Anisotropic diffusion descriptors", 2016; Andreux et al., "Anisotropic Laplace-Beltrami operators
    for shape analysis", 2014.  Angle sense and roles of U_min and U_max as in the released ACD code.
    """
    edges = _opposite_edges(mesh)
    x = np.einsum("mpi,mi->mp", edges, frames.u)
    y = np.einsum("mpi,mi->mp", edges, frames.v)
    xx, yy, xy = (a[:, :, None] * b[:, None, :] for a, b in ((x, x), (y, y), (x, y)))
    pattern = _Pattern.of(mesh)
    return AnisotropicStiffness(
        b0=pattern.assemble(np.einsum("mpi,mqi->mpq", edges, edges)),
        bc=pattern.assemble(xx - yy),
        bs=pattern.assemble(xy + xy.swapaxes(1, 2)),
    )


def _opposite_edges(mesh: Mesh) -> FloatArray:
    """Return the edge opposite each corner, shape (M, 3 corners, 3), running counter-clockwise."""
    return mesh.corners[:, [2, 0, 1]] - mesh.corners[:, [1, 2, 0]]


def _least_areas(mesh: Mesh) -> FloatArray:
    longest: FloatArray = np.linalg.norm(_opposite_edges(mesh), axis=2).max(axis=1)
    return AREA_FLOOR * longest**2


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Where the nine products of every face go in one CSR matrix."""

    slots: IntArray  # (9 M,)
    indices: IntArray
    indptr: IntArray
    quarter_inverse_areas: FloatArray  # (M,)

    @classmethod
    def of(cls, mesh: Mesh) -> _Pattern:
        n = mesh.n_vertices
        rows, columns = np.repeat(mesh.faces, 3, axis=1).ravel(), np.tile(mesh.faces, (1, 3)).ravel()
        keys, slots = np.unique(rows * n + columns, return_inverse=True)
        indptr = np.concatenate([[0], np.cumsum(np.bincount(keys // n, minlength=n))])
        areas = np.maximum(mesh.face_areas, _least_areas(mesh))
        inverse = np.divide(0.25, areas, out=np.zeros_like(areas), where=areas > 0)  # 0: all corners in one point
        return cls(slots, (keys % n).astype(np.int32), indptr.astype(np.int32), inverse)

    def assemble(self, products: FloatArray) -> sparse.csr_array:
        weighted = (products * self.quarter_inverse_areas[:, None, None]).ravel()
        data = np.bincount(self.slots, weighted, minlength=len(self.indices))
        n = len(self.indptr) - 1
        return sparse.csr_array((data, self.indices, self.indptr), shape=(n, n))
