"""The local point signature (LPS): spectra of the geodesic discs around each vertex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.csgraph import dijkstra

from csm._parallel import thread_map
from csm._types import BoolArray, FloatArray, IntArray
from csm.descriptors.base import Descriptor, Features
from csm.mesh.shape import Mesh
from csm.mesh.topology import edge_graph
from csm.operators.geodesic import geodesics
from csm.operators.laplacian import degenerate_faces, stiffness, vertex_areas
from csm.operators.operators import Operators
from csm.operators.spectrum import eigenpairs

_DENSE_BELOW = 400  # vertices; a dense solver is then quicker, and needs no checks
_BLOCK = 32  # vertices whose distances are held in memory together


@dataclass(frozen=True)
class LPS(Descriptor):
    r"""How much of a disc's shape in space each of the lowest frequencies of the disc carries.

    The disc of radius r around a vertex x consists of the faces whose three corners are at most r away from x along
    the edges of the mesh.  It is a mesh by itself, with a free boundary; for its eigenpairs that are not constant,

    .. math:: f_{r,k}(x) = \lambda_k \Big| \int \phi_k(y) \, y \, \mathrm{d}y \Big|, \qquad k = 1 \ldots K,

    where y is the place in space.

    Parameters
    ----------
    radii
        Of the discs, as fractions of the geodesic diameter.
    k
        K, eigenpairs per disc besides the constant one.

    Raises
    ------
    ConfigError
        If there are no radii, one is not positive, or `k` is below 1.

    Notes
    -----
    Each vertex has eigenproblems of its own, one per radius.  With the defaults a built-in human of 6899 vertices,
    whose largest discs have 1000 vertices on average, takes 210 seconds of one thread.  Several threads share the
    vertices.

    Without unit: the scale of the shape plays no part.  It changes with the pose as far as a bend changes the discs,
    and does not tell left from right.

    A disc of fewer than K + 1 vertices has no more eigenpairs than vertices, and the columns of the missing ones are 0
    (a guess: the public code fails there), as are all columns of a vertex whose disc has no face.  A disc that falls
    apart has one constant eigenfunction per part; of these all but one count, with the value 0, as in the public code.

    How distances are measured is a guess, since the function that the public code calls is not part of it; along edges
    they are some 5 % too long.  The diameter is the longest distance that 100 sweeps find.  Faces without area are left
    out of the discs.

    References
    ----------
    Wang, Guo, Yan, Wang, Zhang, "A robust local spectral descriptor for matching non-rigid shapes with incompatible
    shape structures", CVPR 2019, and its public code.

    Examples
    --------
    >>> len(LPS().columns), LPS().columns[0]
    (48, 'r=0.15 k=1')
    """

    radii: tuple[float, ...] = (0.15, 0.1, 0.05)
    k: int = 16

    name: ClassVar[str] = "lps"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "radii", tuple(self.radii))  # a list, where they come from a record
        self.require_at_least(1, "k")
        self.require_positive("radii")

    @property
    def eigenpairs(self) -> int:
        """None of the whole shape."""
        return 0

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the K columns per radius."""
        return tuple(f"r={r:g} k={k}" for r in self.radii for k in range(1, self.k + 1))

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, R K) for R radii, without unit."""
        mesh = operators.mesh
        limits = np.array(self.radii) * geodesics(mesh, "edge").diameter(max_rows=100)
        graph = edge_graph(mesh.vertices, mesh.faces)
        faces = np.delete(mesh.faces, degenerate_faces(mesh), axis=0)

        def rows(block: IntArray) -> FloatArray:
            distances = dijkstra(graph, indices=block, limit=limits.max())
            return np.stack([np.concatenate([self._of_disc(mesh, faces, d <= r) for r in limits]) for d in distances])

        blocks = np.array_split(np.arange(mesh.n_vertices), -(-mesh.n_vertices // _BLOCK))
        return Features(np.concatenate(thread_map(rows, blocks)), self.columns)

    def _of_disc(self, mesh: Mesh, faces: IntArray, inside: BoolArray) -> FloatArray:
        """Return the K values of the disc of the faces whose corners are all `inside`, (N,)."""
        disc = submesh(mesh, faces[inside[faces].all(axis=1)])
        values = np.zeros(self.k)
        found = frequencies(disc, self.k) if disc.n_faces else values[:0]
        values[: len(found)] = found
        return values


def submesh(mesh: Mesh, faces: IntArray) -> Mesh:
    """Return some faces of a mesh, (F, 3), and the vertices that they have, in their order."""
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[faces] = True
    return Mesh(mesh.vertices[used], (np.cumsum(used) - 1)[faces], mesh.name)


def frequencies(disc: Mesh, k: int) -> FloatArray:
    """Return lambda |integral of phi y| for the `k` lowest eigenpairs after the constant one, or as many as there are.

    Parameters
    ----------
    disc
        Every vertex has a face with area.
    k
        At least 1.
    """
    mass, matrix, count = vertex_areas(disc), stiffness(disc), min(k + 1, disc.n_vertices)
    if disc.n_vertices < _DENSE_BELOW:
        root = np.sqrt(mass)
        evals, rooted = eigh(matrix.toarray() / np.outer(root, root), subset_by_index=(0, count - 1))
        moments = rooted.T @ (root[:, None] * disc.vertices)
    else:
        spectrum = eigenpairs(matrix, mass, count, name=disc.label)
        evals, moments = spectrum.evals, spectrum.evecs.T @ (mass[:, None] * disc.vertices)
    values: FloatArray = evals * np.linalg.norm(moments, axis=1)
    return values[1:]
