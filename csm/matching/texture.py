"""Carrying a texture over: new texture coordinates for the source, the same images.

A texture is cut open along seams, where the coordinates of one vertex differ from face to face.  A face of the source
whose corners land on both sides of a seam may therefore not take the coordinates of where its corners land: it would
smear everything between the two places of the image.  So every face of the source takes part in one piece of the
texture only, that of the target's face which its centre lands on.  The coordinates of this face are continued linearly
to where the corners land.  Where a corner's own coordinates agree with this, which they do away from seams, they are
taken, since they are exact and neighbours share them; where they do not, the continuation is.
"""

from __future__ import annotations

import numpy as np

from csm._types import FloatArray, IntArray
from csm.errors import DataError
from csm.matching.barycentric import BarycentricMap, centre_faces
from csm.mesh.check import flat_faces
from csm.mesh.shape import Mesh
from csm.mesh.textured import Textured

_AGREES = 0.5
"""How far a corner's own coordinates may be from the continuation, as a fraction of the face's longest side in uv."""


def pull_texture(texture: Textured, along: BarycentricMap, source: Mesh, target: Mesh) -> Textured:
    """Return the source with the texture of the target.

    Parameters
    ----------
    texture
        The target with its texture: a mesh with the same faces as `target`.
    along
        The map source -> target.
    source, target
        The meshes.

    Returns
    -------
    Textured
        The source with the images of the target; faces with a corner without a partner, or whose centre lands on a face
        without texture, have none.

    Raises
    ------
    DataError
        If the texture is of another mesh than the target.
    """
    if not np.array_equal(texture.mesh.faces, target.faces):
        raise DataError(
            f"{texture.mesh.label}: this textured mesh has {texture.mesh.n_vertices} vertices and "
            f"{texture.mesh.n_faces} faces, and they are not those of {target.label} ({target.n_vertices} and "
            f"{target.n_faces}); match the file that has the texture, or a mesh with the same faces"
        )
    centres = centre_faces(along, source, target)
    uv = np.full((source.n_faces, 3, 2), np.nan)
    known = np.flatnonzero((centres.faces >= 0) & np.isfinite(texture.uv[centres.faces, 0, 0]))
    chart = centres.faces[known]
    continued = _continued(texture, target, chart, along.points(target)[source.faces[known]])
    flat = flat_faces(target)[chart]
    continued[flat] = (centres.weights[known[flat], :, None] * texture.uv[chart[flat]]).sum(1)[:, None]
    own = _own(texture, along, source.faces[known], chart)
    size = np.linalg.norm(continued - np.roll(continued, 1, axis=1), axis=2).max(1)
    agrees = np.linalg.norm(own - continued, axis=2) <= _AGREES * size[:, None]
    uv[known] = np.where(agrees[:, :, None], own, continued)
    image_of = np.full(source.n_faces, -1)
    image_of[known] = texture.image_numbers[chart]
    return Textured(source, uv, texture.images, image_of, texture.notes)


def _continued(texture: Textured, target: Mesh, chart: IntArray, points: FloatArray) -> FloatArray:
    """Continue the coordinates of one face each, shape (P,), to three points, (P, 3, 3), seen along its normal."""
    a = target.corners[chart, 0]
    u, v = target.corners[chart, 1] - a, target.corners[chart, 2] - a
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    away = points - a[:, None]
    along_u, along_v = np.einsum("pij,pj->pi", away, u), np.einsum("pij,pj->pi", away, v)
    area = uu * vv - uv**2
    area = np.where(area > 0, area, 1.0)[:, None]
    second = (along_u * vv[:, None] - along_v * uv[:, None]) / area
    third = (along_v * uu[:, None] - along_u * uv[:, None]) / area
    shares = np.stack([1 - second - third, second, third], axis=2)  # of the corners of the chart's face, (P, 3, 3)
    continued: FloatArray = np.einsum("pic,pcd->pid", shares, texture.uv[chart])
    return continued


def _own(texture: Textured, along: BarycentricMap, corners: IntArray, chart: IntArray) -> FloatArray:
    """Return the coordinates where corners land, shape (P, 3, 2); NaN where that is on another image than the chart."""
    landed = along.faces[corners]
    own: FloatArray = np.einsum("pic,picd->pid", along.weights[corners], texture.uv[landed])
    own[texture.image_numbers[landed] != texture.image_numbers[chart][:, None]] = np.nan
    return own
