"""From the coordinates of a shape to those of a picture: an orthographic camera that looks at the whole shape."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh

Axis: TypeAlias = Literal["x", "y", "z"]

_MARGIN = 0.03
_ALIKE = 0.7  # correlation between vertices and their partners from which one mesh is turned as the other
_RIGHT_UP = {"x": ((0, 0, 1), (1, 0, 0)), "y": ((1, 0, 0), (0, 1, 0)), "z": ((1, 0, 0), (0, 0, 1))}


@dataclass(frozen=True)
class View:
    """Where the viewer stands.

    Parameters
    ----------
    up
        Axis of the data that points up in the picture, or "auto" for the axis along which the shape is longest
        (right for standing people, not for animals).  FAUST and SCAPE: "y"; TOSCA and SHREC'19: "z".
    azimuth
        Degrees that the viewer walks around the up axis, counter-clockwise seen from above.  At 0 the viewer looks at
        the front of a FAUST body: along -z if y is up, along +y if z is up.
    elevation
        Degrees that the viewer looks down from above the horizon.
    height
        Length that the picture's height stands for, in units of the vertices; None fits the shape with a margin.

    Raises
    ------
    ConfigError
        If `up` is not an axis or `height` is not positive.
    """

    up: Axis | Literal["auto"] = "y"
    azimuth: float = 0.0
    elevation: float = 8.0
    height: float | None = None

    def __post_init__(self) -> None:
        if self.up not in (*_RIGHT_UP, "auto"):
            raise ConfigError(f"view: up is {self.up!r}, wanted one of x, y, z or auto")
        if self.height is not None and not self.height > 0:
            raise ConfigError(f"view: height is {self.height}, wanted a positive length or none to fit the shape")


def guess_up(mesh: Mesh) -> Axis:
    """Return the coordinate axis along which the shape is longest."""
    axes: tuple[Axis, ...] = ("x", "y", "z")
    return axes[int(np.argmax(np.ptp(mesh.vertices, axis=0)))]


def body_axes(mesh: Mesh, up: Axis | Literal["auto"]) -> FloatArray:
    """Return, as rows, the unit directions right, up and front of the data: the viewer's at azimuth and elevation 0."""
    right, upward = np.array(_RIGHT_UP[guess_up(mesh) if up == "auto" else up], dtype=np.float64)
    return np.stack([right, upward, np.cross(right, upward)])


def turned_alike(mesh: Mesh, to_reference: IntArray, reference: Mesh, up: Axis | Literal["auto"]) -> FloatArray:
    """Return axes of a mesh with which it is seen as another is with its own, whichever way the files have them stand.

    Parameters
    ----------
    mesh
        N vertices.
    to_reference
        Shape (N,), the vertex of the reference that each vertex is mapped to, or -1.
    reference
        The other mesh.
    up
        Axis that points up, as in `body_axes`: of the reference, and of a mesh that no rotation brings near to it, as
        where the map is wrong.

    Returns
    -------
    FloatArray
        Shape (3, 3): the reference's `body_axes`, turned by the rotation that brings the vertices nearest to their
        partners, both at one size around their middles.
    """
    from scipy.spatial.transform import Rotation

    known = np.flatnonzero(to_reference >= 0)
    here, there = mesh.vertices[known], reference.vertices[to_reference[known]]
    here, there = (points - points.mean(axis=0) for points in (here, there)) if known.size else (here, there)
    sizes = np.linalg.norm(here), np.linalg.norm(there)
    if known.size < 3 or not min(sizes) > 0:
        return body_axes(mesh, up)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of flat meshes, which any of several rotations suits
        found, apart = Rotation.align_vectors(there / sizes[1], here / sizes[0])
    turned: FloatArray = body_axes(reference, up) @ found.as_matrix()
    return turned if 1 - apart**2 / 2 >= _ALIKE else body_axes(mesh, up)


def rotation(mesh: Mesh, view: View) -> FloatArray:
    """Return, as rows, the picture's right, its up and the direction towards the viewer; a proper rotation (3, 3)."""
    right, upward, front = body_axes(mesh, view.up)
    a, e = np.radians(view.azimuth), np.radians(view.elevation)
    turned = np.cos(a) * right - np.sin(a) * front
    towards = np.cos(e) * (np.cos(a) * front + np.sin(a) * right) + np.sin(e) * upward
    return np.stack([turned, np.cross(towards, turned), towards])


def project(mesh: Mesh, view: View, width: int, height: int) -> FloatArray:
    """Return pixel coordinates and depth of the vertices, shape (N, 3): x right, y down, z away, all in pixels.

    Vertices without a face have no say in the framing.
    """
    seen = mesh.vertices @ rotation(mesh, view).T
    used = seen[np.unique(mesh.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    if view.height is not None:
        scale = height / view.height
    else:
        extent = np.maximum(high - low, 1e-12 * max(1.0, float(np.abs(used).max())))
        scale = (1 - 2 * _MARGIN) * float(min(width / extent[0], height / extent[1]))
    points: FloatArray = (seen - 0.5 * (low + high)) * scale * np.array([1.0, -1.0, -1.0])
    points[:, :2] += width / 2, height / 2
    return points
