"""Pictures of meshes without a display or graphics card, the same bytes every time.

A picture is made in two passes over a supersampled grid of pixels: the first finds the triangle nearest to the viewer
(`raster`), the second interpolates normal and colour inside that triangle and lights it (`shade`).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from csm._types import Float32Array, FloatArray, IntArray
from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, project, rotation
from csm.viewer.picture import Picture
from csm.viewer.raster import Fragments, fragments_at, interpolate, visible_faces
from csm.viewer.shade import creases, encoded, light, linear

DEFAULT_COLOR = (196, 203, 214)


def render(
    mesh: Mesh,
    colors: ArrayLike | None = None,
    *,
    size: tuple[int, int] = (600, 800),
    view: View | None = None,
    background: Literal["white", "transparent"] = "white",
    lighting: bool = True,
    supersample: int = 2,
) -> Picture:
    """Draw a mesh.

    Parameters
    ----------
    mesh
        N vertices, M faces; both sides of a face are drawn.
    colors
        One colour (3,) or one per vertex (N, 3): uint8, or floats from 0 to 1; a light grey by default.
    size
        Width and height in pixels.
    view
        Where the viewer stands; `View()` by default, which looks at a y-up body from the front.
    background
        "white" gives three channels, "transparent" four with straight (not premultiplied) alpha.
    lighting
        False paints the plain colours, so that they can be read off exactly.
    supersample
        Samples per pixel along each axis; 2 is quick, 4 is for print.

    Returns
    -------
    Picture
        Shape (height, width, 3 or 4), uint8, sRGB, first row at the top.

    Raises
    ------
    MeshError
        If the mesh has no face or a coordinate is not finite.
    ConfigError
        If the colours or another option cannot be used.
    """
    _require_drawable(mesh, size, supersample, background)
    vertex_colors = linear(as_colors(colors, mesh.n_vertices)).astype(np.float32)
    view = view or View()
    width, height = size[0] * supersample, size[1] * supersample
    triangles = project(mesh, view, width, height)[mesh.faces]
    nearest = visible_faces(triangles, width, height)
    covered = np.flatnonzero(nearest >= 0)
    seen = fragments_at(triangles, nearest, covered, width)
    surface = interpolate(seen.weights, vertex_colors, mesh.faces[seen.face])
    if lighting:
        surface = light(surface, _normals(mesh, view, seen), creases(seen.depth, covered, (height, width)))
    return _finish(surface, covered, size, supersample, background)


def as_colors(colors: ArrayLike | None, n: int) -> FloatArray:
    """Return colours as floats from 0 to 1, shape (n, 3), from uint8 or floats, one for all or one for each.

    Raises
    ------
    ConfigError
        If the shape is neither (3,) nor (n, 3), integers are not in 0..255, or floats are not in 0..1.
    """
    given: NDArray[Any] = np.asarray(DEFAULT_COLOR if colors is None else colors)
    if given.shape not in ((3,), (n, 3)):
        raise ConfigError(
            f"colours have shape {given.shape}, wanted (3,) or ({n}, 3): one RGB colour or one per vertex"
        )
    values = given / 255.0 if np.issubdtype(given.dtype, np.integer) else given.astype(np.float64)
    if not (np.isfinite(values).all() and values.min(initial=0) >= 0 and values.max(initial=0) <= 1):
        raise ConfigError("colours leave their range: wanted integers from 0 to 255 or floats from 0 to 1")
    return np.broadcast_to(values, (n, 3))


def _require_drawable(mesh: Mesh, size: tuple[int, int], supersample: int, background: str) -> None:
    if mesh.n_faces == 0:
        raise MeshError(f"{mesh.label}: there are no faces to draw")
    finite = np.isfinite(mesh.vertices).all(axis=1)
    if not finite.all():
        bad = int(np.argmin(finite))
        raise MeshError(f"{mesh.label}: vertex {bad} is not finite, so the shape cannot be drawn; run `csm check`")
    if min(size) < 1 or supersample < 1:
        raise ConfigError(f"picture of {size[0]} x {size[1]} pixels with {supersample} samples: all must be 1 or more")
    if background not in ("white", "transparent"):
        raise ConfigError(f"background is {background!r}, wanted white or transparent")


def _normals(mesh: Mesh, view: View, seen: Fragments) -> Float32Array:
    """Return the smooth normal at each fragment in the viewer's frame, shape (P, 3), not of unit length."""
    normals = (mesh.vertex_normals @ rotation(mesh, view).T).astype(np.float32)
    return interpolate(seen.weights, normals, mesh.faces[seen.face])


def _finish(surface: Float32Array, covered: IntArray, size: tuple[int, int], samples: int, background: str) -> Picture:
    """Average the samples of each pixel in linear light and encode them."""
    width, height = size
    row, column = covered // (width * samples) // samples, covered % (width * samples) // samples
    pixel = row * width + column
    sums = [np.bincount(pixel, weights, minlength=width * height) for weights in (None, *surface.T)]
    alpha, *color = np.stack(sums).reshape(4, height, width) / samples**2
    if background == "white":
        return _bytes(encoded(np.stack(color, axis=-1) + (1 - alpha[..., None])))
    straight = encoded(np.stack(color, axis=-1) / np.maximum(alpha, 1e-6)[..., None])
    return _bytes(np.dstack([straight, alpha]))


def _bytes(fractions: NDArray[np.floating[Any]]) -> Picture:
    return np.round(fractions * 255).astype(np.uint8)
