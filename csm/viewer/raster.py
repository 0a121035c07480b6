"""Rasterising: which triangle is seen in which pixel, and where inside it, without a graphics card."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from csm._types import FloatArray, IntArray

_BLOCK = 4_000_000  # pixels of triangles held at once


class Fragments(NamedTuple):
    """What is seen in each of P covered pixels."""

    face: IntArray
    """(P,) face index."""
    weights: NDArray[np.float32]
    """(P, 3) barycentric weights of the pixel's centre."""
    depth: NDArray[np.float32]
    """(P,) distance from the viewer, in pixels."""


def _ranges(start: IntArray, stop: IntArray) -> tuple[IntArray, IntArray]:
    """For rows i of integers start[i]..stop[i]-1 return, flattened, i and the integers."""
    count = np.maximum(stop - start, 0)
    owner = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return owner, np.arange(len(owner)) - np.repeat(first - start, count)


def _row_spans(triangles: FloatArray, width: int, height: int) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Intersect triangles with pixel rows: face, row, first column, end column of every non-empty span.

    A pixel is inside if its centre is; centres on a shared edge belong to exactly one of the two triangles.
    """
    y = triangles[:, :, 1] - 0.5
    start = np.clip(np.ceil(y.min(axis=1)), 0, height).astype(np.int64)
    stop = np.clip(np.ceil(y.max(axis=1)), 0, height).astype(np.int64)
    face, row = _ranges(start, stop)
    left, right = np.full(len(face), np.inf), np.full(len(face), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        swap = (y[:, i] > y[:, j])[:, None]  # both triangles at an edge must compute the same crossing
        a = np.where(swap, triangles[:, j], triangles[:, i])
        b = np.where(swap, triangles[:, i], triangles[:, j])
        slope = (b[:, 0] - a[:, 0]) / np.where(b[:, 1] > a[:, 1], b[:, 1] - a[:, 1], 1.0)
        below = row + 0.5 - a[face, 1]
        crossed = (below >= 0) & (row + 0.5 < b[face, 1])
        x = a[face, 0] + below * slope[face]
        left = np.where(crossed, np.minimum(left, x), left)
        right = np.where(crossed, np.maximum(right, x), right)
    crossed = left <= right
    first, end = (np.clip(np.ceil(np.where(crossed, x, 0) - 0.5), 0, width).astype(np.int64) for x in (left, right))
    keep = end > first
    return face[keep], row[keep], first[keep], end[keep]


def _depth_planes(triangles: FloatArray) -> FloatArray:
    """Coefficients (M, 3) of depth = a x + b y + c over each projected triangle; nearest depth if seen edge-on."""
    d1, d2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(d1, d2)
    solid = np.abs(normal[:, 2]) > 1e-9
    slope = -normal[:, :2] / np.where(solid, normal[:, 2], 1.0)[:, None]
    slope[~solid] = 0.0
    offset = triangles[:, 0, 2] - (slope * triangles[:, 0, :2]).sum(axis=1)
    offset[~solid] = triangles[~solid, :, 2].min(axis=1)
    return np.column_stack([slope, offset])


def visible_faces(triangles: FloatArray, width: int, height: int) -> IntArray:
    """Return the nearest face per pixel, flattened row by row, -1 for the background.

    Triangles have shape (M, 3 corners, 3), in pixels: right, down and away from the viewer.  Of two faces at the same
    depth the one with the lower index is seen.
    """
    face, row, first, end = _row_spans(triangles, width, height)
    planes, low, high = _depth_planes(triangles), triangles[:, :, 2].min(axis=1), triangles[:, :, 2].max(axis=1)
    steps = (2**31 - 1) / max(float(high.max() - low.min()), 1e-9)
    empty = np.iinfo(np.int64).max
    buffer = np.full(width * height, empty)
    starts = np.searchsorted(np.cumsum(end - first), np.arange(0, (end - first).sum(), _BLOCK)).tolist()
    for a, b in pairwise([*starts, len(face)]):
        span, x = _ranges(first[a:b], end[a:b])
        f, y = face[a:b][span], row[a:b][span]
        depth = planes[f, 0] * (x + 0.5) + planes[f, 1] * (y + 0.5) + planes[f, 2]
        depth = np.clip(depth, low[f], high[f]) - low.min()
        np.minimum.at(buffer, y * width + x, ((depth * steps).astype(np.int64) << 32) | f)
    return np.where(buffer == empty, -1, buffer & 0xFFFFFFFF)


def fragments_at(triangles: FloatArray, nearest: IntArray, covered: IntArray, width: int) -> Fragments:
    """Locate the centres of covered pixels inside the faces seen there.

    Parameters
    ----------
    triangles
        Shape (M, 3 corners, 3), in pixels.
    nearest
        Face per pixel, as from `visible_faces`.
    covered
        Shape (P,), flat indices of the pixels that show a face.
    width
        Of the picture, in pixels.
    """
    face = nearest[covered]
    a, d1, d2 = triangles[:, 0, :2], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    double_area = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    inverse = 1.0 / np.where(np.abs(double_area) > 1e-9, double_area, np.inf)
    x, y = covered % width + 0.5 - a[face, 0], covered // width + 0.5 - a[face, 1]
    w1 = (x * d2[face, 1] - y * d2[face, 0]) * inverse[face]
    w2 = (y * d1[face, 0] - x * d1[face, 1]) * inverse[face]
    weights = np.clip(np.stack([1 - w1 - w2, w1, w2], axis=1), 0, 1).astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    depth = np.einsum("pk,pk->p", weights, triangles[face, :, 2].astype(np.float32))
    return Fragments(face, weights, depth)


def interpolate(weights: NDArray[np.float32], values: NDArray[np.float32], corners: IntArray) -> NDArray[np.float32]:
    """Return values (N, C) at the corners (P, 3), combined by the weights (P, 3); shape (P, C)."""
    result: NDArray[np.float32] = weights[:, :1] * values[corners[:, 0]]
    for k in (1, 2):
        result += weights[:, k : k + 1] * values[corners[:, k]]
    return result
