r"""Places of neighbouring vertices, averaged along the surface.

A classifier decides on every vertex by itself, so the places of neighbours differ by more than the vertices do.  Where
the truth is a smooth map, a low-pass along the shape takes that difference out:

.. math:: \hat q = \Phi \, \frac{1}{1 + (t \lambda)^2} \, \Phi^T A \, q
                 = \operatorname{Re} \left[ (A + i \, t S)^{-1} A \, q \right]

with the stiffness S, the areas A of the vertices, and all eigenpairs of  S phi = lambda A phi.  It is flat where the
diffusion (1 + t lambda)^{-1} falls already, so less of the map itself is lost.  One sparse factor computes it, without
eigenpairs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu
from torch import Tensor
from torch.nn import functional

from csm._types import FloatArray
from csm.mesh.shape import Mesh
from csm.operators.laplacian import stiffness, vertex_areas

TIME = 3e-4
"""t in units of the area of the shape: what is finer than a fiftieth of the root of the area is averaged."""

_BLOCK = 64  # columns at a time, which bounds the memory


def diffusion(mesh: Mesh, time: complex) -> tuple[FloatArray, Callable[[NDArray[Any]], NDArray[Any]]]:
    """Return the vertex areas A, shape (N,), and what solves  (A + time S) x = b  with the stiffness S.

    Parameters
    ----------
    mesh
        The shape; a vertex without faces counts as one of very little area.
    time
        In units of the area of the shape; imaginary for the low-pass of this module.
    """
    areas = vertex_areas(mesh)
    area = float(areas.sum())
    areas = np.maximum(areas, 1e-12 * area)
    return areas, splu(sparse.csc_array(sparse.diags_array(areas) + time * area * stiffness(mesh))).solve


def smoothed(rows: Tensor, mesh: Mesh) -> Tensor:
    """Return features of the vertices of a mesh, averaged along its surface, rows of unit length.

    Parameters
    ----------
    rows
        Shape (N, K), as `csm.learning.places.Places` returns them, of unit length.
    mesh
        The shape, of any size; a vertex without faces keeps its row.

    Returns
    -------
    Tensor
        Shape (N, K), of the type and on the device of `rows`.

    Examples
    --------
    >>> import csm
    >>> mesh = csm.load_humans().mesh("s00_p00")
    >>> alike = torch.nn.functional.normalize(torch.ones(mesh.n_vertices, 4), dim=1)
    >>> torch.allclose(smoothed(alike, mesh), alike, atol=1e-5)
    True
    """
    areas, solve = diffusion(mesh, 1j * TIME)
    given = areas[:, None] * rows.double().cpu().numpy()
    for begin in range(0, given.shape[1], _BLOCK):
        given[:, begin : begin + _BLOCK] = solve(given[:, begin : begin + _BLOCK].astype(complex)).real
    return functional.normalize(torch.from_numpy(given).to(rows), dim=1)
