"""Colours of vertices: by position, by value, and transferred along a map."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.viewer.camera import Axis, body_axes
from csm.viewer.shade import encoded

Colors: TypeAlias = NDArray[np.uint8]

UNMATCHED = (168, 168, 168)
ERROR_COLORMAP = "YlOrRd"

RAMPS = {
    "confidence": "00224d 003070 2a3f6d 434e6b 575d6d 696b71 7c7b78 908b77 a59b73 bbad6c d2bf60 e9d24d fde737",
    "errors": "ffffcc ffeda0 fed976 feb24c fd8d3c fc4e2a e31a1c bd0026 800026",
    "distance": "081d58 253494 225ea8 1d91c0 41b6c4 7fcdbb c7e9b4 edf8b1 ffffd9",
}
"""Stops of the colours of numbers on pages, all monotone in lightness, so that they need no colour vision.

Confidence has those of cividis (Nunez, Anderton and Renslow 2018), the others have those of YlOrRd and YlGnBu of
ColorBrewer (Harrower and Brewer 2003).
"""

_BINS = 32
_GREY: Colors = np.array(UNMATCHED, dtype=np.uint8)

# Björn Ottosson, "A perceptual color space for image processing" (Oklab), 2020: Oklab -> cube roots of LMS -> RGB.
_LMS = np.array([[1, 0.3963377774, 0.2158037573], [1, -0.1055613458, -0.0638541728], [1, -0.0894841775, -1.2914855480]])
_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def position_colors(mesh: Mesh, *, up: Axis | Literal["auto"] = "auto") -> Colors:
    """Colour each vertex by where it is, so that neighbours look alike and left, right and the limbs differ.

    Left to right runs from orange to blue, which people with red-green blindness tell apart as well as others do.
    Bottom to top runs from dark to light and, for those who see it, from red to green; the back is darker than the
    front.  Half of each is by rank, so that a long arm does not leave the torso without contrast.

    Parameters
    ----------
    mesh
        N vertices.
    up
        Axis of the data that points up; see `View.up`.

    Returns
    -------
    Colors
        Shape (N, 3), uint8.
    """
    right, height, front = (2 * _spread(x) - 1 for x in body_axes(mesh, up) @ mesh.vertices.T)
    side = np.sin(0.5 * np.pi * right)  # steepest in the middle, where left and right are neighbours
    lab = np.stack([0.69 + 0.13 * height + 0.05 * front, -0.10 * height - 0.02 * side, -0.16 * side], axis=1)
    return _from_oklab(lab)


def scalar_colors(
    values: ArrayLike, low: float | None = None, high: float | None = None, colormap: str = "viridis"
) -> Colors:
    """Colour values (N,) by a matplotlib colour map; values that are not finite become grey.

    Parameters
    ----------
    values
        Shape (N,).
    low, high
        Values of the first and last colour; the least and greatest finite value by default.
    colormap
        Name of a matplotlib colour map; the default and `ERROR_COLORMAP` are monotone in lightness.

    Raises
    ------
    ConfigError
        If there is no such colour map.
    """
    from matplotlib import colormaps

    if colormap not in colormaps:
        raise ConfigError(f"{colormap!r} is not a colour map of matplotlib; try viridis, cividis or {ERROR_COLORMAP}")
    given = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(given)
    known = given[finite] if finite.any() else np.zeros(1)
    first, last = known.min() if low is None else low, known.max() if high is None else high
    fraction = np.clip((np.where(finite, given, first) - first) / max(last - first, 1e-300), 0, 1)
    colors: Colors = colormaps[colormap](fraction, bytes=True)[:, :3]
    return np.where(finite[:, None], colors, _GREY)


def ramp(name: str, shades: int) -> Colors:
    """Return the colours of one of the `RAMPS` from its first to its last, shape (shades, 3); matplotlib is not needed.

    Examples
    --------
    >>> ramp("errors", 2)
    array([[255, 255, 204],
           [128,   0,  38]], dtype=uint8)
    """
    stops = np.array([list(bytes.fromhex(stop)) for stop in RAMPS[name].split()])
    at = np.linspace(0, len(stops) - 1, shades)
    channels = [np.interp(at, np.arange(len(stops)), channel) for channel in stops.T]
    colors: Colors = np.rint(np.stack(channels, axis=1)).astype(np.uint8)
    return colors


def pull_colors(to_colors: ArrayLike, indices: IntArray) -> Colors:
    """Transfer colours along a map: each vertex takes the colour of the vertex that it is mapped to, grey without one.

    Parameters
    ----------
    to_colors
        Shape (n_to, 3), uint8: the colours of the shape that the map goes to.
    indices
        Shape (n_from,), the map: vertices of the shape that it goes to, or -1.

    Returns
    -------
    Colors
        Shape (n_from, 3), uint8.

    Raises
    ------
    ConfigError
        If the map refers to a vertex that has no colour.
    """
    colors, indices = np.asarray(to_colors, dtype=np.uint8), np.asarray(indices)
    _require_map(indices, len(colors))
    return np.where(indices[:, None] >= 0, colors[indices], _GREY)


def _require_map(indices: IntArray, n_to: int) -> None:
    if indices.ndim != 1 or indices.dtype.kind not in "iu":
        raise ConfigError(f"a map is {indices.dtype} of shape {indices.shape}, wanted a vector of vertex numbers")
    if indices.min(initial=-1) < -1 or indices.max(initial=-1) >= n_to:
        bad = int(np.flatnonzero((indices < -1) | (indices >= n_to))[0])
        raise ConfigError(f"a map sends vertex {bad} to {indices[bad]}, wanted 0..{n_to - 1}, or -1 for no counterpart")


def _spread(x: FloatArray) -> FloatArray:
    """Map values to 0..1, half by size and half by rank; the rank is read off a coarse histogram, hence smooth."""
    low, high = float(x.min()), float(x.max())
    grid = np.linspace(low, high + 1e-12 * max(abs(low), abs(high), 1e-300), _BINS + 1)
    rank = np.searchsorted(np.sort(x), grid) / len(x)
    size = (x - low) / max(high - low, 1e-300)
    spread: FloatArray = 0.5 * size + 0.5 * np.interp(x, grid, rank)
    return spread


def _from_oklab(lab: FloatArray) -> Colors:
    rgb = (lab @ _LMS.T) ** 3 @ _RGB.T
    return np.round(encoded(rgb) * 255).astype(np.uint8)
