"""Light, creases and the sRGB curve: from what is seen in a pixel to its colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._types import Float32Array, FloatArray, IntArray


def _unit(*direction: float) -> Float32Array:
    vector = np.array(direction, dtype=np.float32)
    return vector / np.linalg.norm(vector)


# Directions towards the lights in the viewer's frame (right, up, towards the viewer), and their strengths.
_KEY, _FILL = _unit(-0.45, 0.60, 0.66), _unit(0.85, 0.05, 0.52)
_KEY_POWER, _FILL_POWER, _AMBIENT, _SKY, _GLOSS = 0.74, 0.20, 0.17, 0.06, 0.06
_SOFTNESS = 0.15  # how far the key light reaches around the edge of its shadow
_CREASE_RADIUS, _CREASE_DEPTH = 0.012, 0.55  # of the picture's height; fraction of light lost in the deepest crease


def light(surface: Float32Array, normals: Float32Array, crease: Float32Array) -> Float32Array:
    """Light surface colours (P, 3) with normals (P, 3) in the viewer's frame; where crease (P,) is 1, it is darkest."""
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.float32(1e-6))
    normals *= np.where(normals[:, 2:] < 0, np.float32(-1), np.float32(1))  # an open shape has an inside to be seen
    halfway = _unit(*(_KEY + np.array([0, 0, 1], dtype=np.float32)))
    gloss = _GLOSS * np.clip(normals @ halfway, 0, 1) ** 32
    key = _KEY_POWER * np.clip((1 - _SOFTNESS) * (normals @ _KEY) + _SOFTNESS, 0, 1)
    fill = _FILL_POWER * np.clip(normals @ _FILL, 0, 1)
    total = (key + fill + _AMBIENT + _SKY * normals[:, 1]) * (1 - _CREASE_DEPTH * crease)
    lit: Float32Array = np.clip(surface * total[:, None] + gloss[:, None], 0, 1)
    return lit


def creases(depth: Float32Array, covered: IntArray, shape: tuple[int, int]) -> Float32Array:
    """Return how far each covered pixel (P,) lies behind the blurred surface around it, 0 to 1: cheap occlusion.

    Source: Luft, Colditz, Deussen, "Image enhancement by unsharp masking the depth buffer", ACM TOG 25(3), 2006; here
    the blur looks at covered pixels only, so that an outline throws no halo.
    """
    if covered.size == 0:
        return np.zeros(0, np.float32)
    from scipy.ndimage import gaussian_filter  # here, since pages need the curve of this module only

    radius = _CREASE_RADIUS * shape[0]
    row, column = covered // shape[1], covered % shape[1]
    here = (row - row.min(), column - column.min())  # only the part of the picture that shows something is blurred
    mask, field = np.zeros((2, int(here[0].max()) + 1, int(here[1].max()) + 1), np.float32)
    mask[here], field[here] = 1, depth
    weight, blurred = (gaussian_filter(a, radius, truncate=2, mode="constant")[here] for a in (mask, field))
    behind: Float32Array = np.clip((depth - blurred / np.maximum(weight, np.float32(1e-6))) / (4 * radius), 0, 1)
    return behind.astype(np.float32, copy=False)


def linear(srgb: FloatArray) -> FloatArray:
    """Decode sRGB values from 0 to 1 to linear light (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def encoded(light: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Encode linear light from 0 to 1 as sRGB (IEC 61966-2-1)."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
