"""Many meshes of one connectivity in few bytes: 16-bit coordinates, as differences along the vertices."""

from __future__ import annotations

import numpy as np

from csm._types import Arrays, FloatArray


def pack(shapes: FloatArray) -> Arrays:
    """Return the arrays that `unpack` reads.

    Parameters
    ----------
    shapes
        Vertices, (S, N, 3).

    Returns
    -------
    dict
        `differences` (S, N, 3) uint16: coordinates in steps, as differences along the vertices modulo 2**16; `offset`
        (S, 3) and `step` (S,) in the unit of the shapes.

    Examples
    --------
    >>> shape = np.random.default_rng(0).random((1, 5, 3))
    >>> bool(abs(unpack(pack(shape), 0) - shape[0]).max() < 1e-5)
    True
    """
    low, high = shapes.min(axis=1), shapes.max(axis=1)
    step = (high - low).max(axis=1) / 65535
    levels = np.round((shapes - low[:, None]) / step[:, None, None]).astype(np.uint16)
    return {"differences": np.diff(levels, axis=1, prepend=np.uint16(0)), "offset": low, "step": step}


def unpack(arrays: Arrays, index: int) -> FloatArray:
    """Return the vertices (N, 3) of one shape of what `pack` made."""
    levels = np.cumsum(arrays["differences"][index], axis=0, dtype=np.uint16)
    vertices: FloatArray = arrays["offset"][index] + arrays["step"][index] * levels
    return vertices
