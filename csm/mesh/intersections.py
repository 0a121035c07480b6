"""Triangles of a mesh that cut through each other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from csm._types import BoolArray, FloatArray, IntArray


def intersecting_pairs(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Pairs of faces without a common vertex that intersect, shape (P, 2).

    Two triangles intersect if an edge of one meets the inside of the other; candidates come from bounding spheres in
    classes of size, so that a few large triangles do not spoil the search.

    Parameters
    ----------
    vertices, faces
        Shapes (N, 3) and (M, 3).

    Examples
    --------
    >>> two = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, -1], [0.5, 0.5, 1], [3, 3, 1.0]])
    >>> intersecting_pairs(two, np.array([[0, 1, 2], [3, 4, 5]])).tolist()
    [[0, 1]]
    """
    pairs = candidate_pairs(vertices[faces])
    shared = (faces[pairs[:, 0]][:, :, None] == faces[pairs[:, 1]][:, None, :]).any(axis=(1, 2))
    pairs = pairs[~shared]
    a, b = vertices[faces[pairs[:, 0]]], vertices[faces[pairs[:, 1]]]
    hit = np.zeros(len(pairs), bool)
    for k in range(3):
        hit |= segment_meets(a[:, k], a[:, (k + 1) % 3], b)
        hit |= segment_meets(b[:, k], b[:, (k + 1) % 3], a)
    found: IntArray = pairs[hit]
    return found


def candidate_pairs(corners: FloatArray) -> IntArray:
    """Pairs of triangles whose bounding boxes overlap, shape (P, 2)."""
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    size = np.clip(np.floor(np.log2(radius / radius.max())).astype(int), -6, -1)
    found = []
    classes = [np.flatnonzero(size == s) for s in range(-6, 0)]
    for i, small in enumerate(classes):
        for large in classes[i:]:
            if not (small.size and large.size):
                continue
            reach = radius[small].max() + radius[large].max()
            trees = cKDTree(centre[small]), cKDTree(centre[large])
            near = trees[0].sparse_distance_matrix(trees[1], reach, output_type="ndarray")
            found.append(np.column_stack([small[near["i"]], large[near["j"]]]))
    pairs = np.concatenate(found)
    low, high = corners.min(axis=1), corners.max(axis=1)
    overlap = ((low[pairs[:, 0]] <= high[pairs[:, 1]]) & (low[pairs[:, 1]] <= high[pairs[:, 0]])).all(axis=1)
    pairs = pairs[overlap & (pairs[:, 0] != pairs[:, 1])]
    return np.unique(np.sort(pairs, axis=1), axis=0)


def segment_meets(p: FloatArray, q: FloatArray, triangles: FloatArray) -> BoolArray:
    """Whether segment i from p to q passes through triangle i (Moller and Trumbore 1997), shape (P,)."""
    origin, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    direction = q - p
    h = np.cross(direction, e2)
    det = (e1 * h).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = p - origin
        u = (s * h).sum(1) / det
        r = np.cross(s, e1)
        v = (direction * r).sum(1) / det
        t = (e2 * r).sum(1) / det
        meets: BoolArray = (np.abs(det) > 1e-18) & (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)
    return meets
