"""Splitting of polygons in space into triangles: quads along a diagonal, larger ones ear by ear."""

from __future__ import annotations

import numpy as np

from csm._types import BoolArray, FloatArray, IntArray


def split_polygons(vertices: FloatArray, corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return triangles (M, 3), the polygon of each (M,), and the polygons whose triangles overlap.

    Triangles are in the order of the polygons; those of fewer than three corners give none.
    """
    starts = np.cumsum(sizes) - sizes
    faces, owners, crossing = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], []
    for size in np.unique(sizes[sizes > 2]):
        polygons = np.flatnonzero(sizes == size)
        rings = corners[starts[polygons, None] + np.arange(size)]
        triangles, bad = _split_rings(vertices, rings)
        faces.append(triangles.reshape(-1, 3))
        owners.append(np.repeat(polygons, size - 2))
        crossing += polygons[bad].tolist()
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(faces)[order], owner[order], np.array(sorted(crossing), dtype=np.int64)


def _split_rings(vertices: FloatArray, rings: IntArray) -> tuple[IntArray, BoolArray]:
    """Split polygons of one size, shape (P, n), into triangles (P, n - 2, 3); tell which could not be split cleanly."""
    size = rings.shape[1]
    if size == 3:
        return rings[:, None], np.zeros(len(rings), dtype=bool)
    if size == 4:
        return _split_quads(vertices, rings), np.zeros(len(rings), dtype=bool)
    points = _in_mean_planes(vertices[rings])
    steps = np.arange(1, size - 1)
    fan = np.stack([np.zeros_like(steps), steps, steps + 1], axis=1)
    triangles = rings[:, fan]
    bad = np.zeros(len(rings), dtype=bool)
    for i in np.flatnonzero(~_convex(points)):
        ears = clip_ears(points[i])
        bad[i] = ears is None
        if ears is not None:
            triangles[i] = rings[i][ears]
    return triangles, bad


def _split_quads(vertices: FloatArray, quads: IntArray) -> IntArray:
    """Split quads (P, 4) along a diagonal, (P, 2, 3): one with triangles that agree, then the shorter, then 0-2."""
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    agree_ac = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(1) > 0
    agree_bd = (np.cross(b - a, d - a) * np.cross(c - b, d - b)).sum(1) > 0
    length_ac, length_bd = ((c - a) ** 2).sum(1), ((d - b) ** 2).sum(1)
    shorter_bd = length_bd < length_ac * (1 - 1e-9)
    along_bd = np.where(agree_ac == agree_bd, shorter_bd, agree_bd)
    split: IntArray = np.where(
        along_bd[:, None, None], quads[:, [[0, 1, 3], [1, 2, 3]]], quads[:, [[0, 1, 2], [0, 2, 3]]]
    )
    return split


def _in_mean_planes(rings: FloatArray) -> FloatArray:
    """Project polygons (P, n, 3) along their mean normals, so that each runs counter-clockwise; shape (P, n, 2)."""
    centred = rings - rings.mean(axis=1, keepdims=True)
    normals = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    normals[length[:, 0] == 0] = [0.0, 0.0, 1.0]
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(axis, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frame = np.stack([first, np.cross(normals, first)], axis=2)
    projected: FloatArray = centred @ frame
    return projected


def _convex(points: FloatArray) -> BoolArray:
    """Tell which polygons (P, n, 2), run counter-clockwise, are strictly convex and wind once."""
    edges = np.roll(points, -1, axis=1) - points
    following = np.roll(edges, -1, axis=1)
    turns = _cross(edges, following)
    angles = np.arctan2(turns, (edges * following).sum(axis=-1)).sum(axis=1)
    strict: BoolArray = (turns > 0).all(axis=1) & (np.abs(angles - 2 * np.pi) < 1)
    return strict


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def clip_ears(points: FloatArray) -> IntArray | None:
    """Split a polygon in the plane, (n, 2), counter-clockwise, into triangles (n - 2, 3) by cutting off its ears.

    An ear is a corner whose triangle turns left and holds no other corner.  Corners on a straight line make no ear of
    their own until nothing else is left, since they would give triangles without area.

    Returns
    -------
    Triangles as numbers of corners, or None if a stage has no ear or the rest is inside out: the polygon
    crosses itself.
    """
    ring = list(range(len(points)))
    triangles: list[tuple[int, int, int]] = []
    at = 0
    while len(ring) > 3:
        found = next((k for k in range(at, at + len(ring)) if _is_ear(points, ring, k % len(ring))), None)
        if found is None:
            found = next((k for k in range(len(ring)) if _is_flat(points, ring, k)), None)
            if found is None:
                return None
        k = found % len(ring)
        triangles.append((ring[k - 1], ring[k], ring[(k + 1) % len(ring)]))
        del ring[k]
        at = k
    turn, none = _turn(points, ring, 1)
    if turn < -none:
        return None
    triangles.append((ring[0], ring[1], ring[2]))
    return np.array(triangles, dtype=np.int64)


def _turn(points: FloatArray, ring: list[int], k: int) -> tuple[float, float]:
    """Return twice the signed area at corner k of the ring, and what counts as none at its size."""
    a, b, c = points[ring[k - 1]], points[ring[k]], points[ring[(k + 1) % len(ring)]]
    size = max(float(np.abs(b - a).max()), float(np.abs(c - b).max()))
    return float(_cross(b - a, c - b)), 1e-12 * size * size


def _is_flat(points: FloatArray, ring: list[int], k: int) -> bool:
    turn, none = _turn(points, ring, k)
    return abs(turn) <= none


def _is_ear(points: FloatArray, ring: list[int], k: int) -> bool:
    turn, none = _turn(points, ring, k)
    if turn <= none:
        return False
    triangle = points[[ring[k - 1], ring[k], ring[(k + 1) % len(ring)]]]
    others = points[[i for j, i in enumerate(ring) if j not in ((k - 1) % len(ring), k, (k + 1) % len(ring))]]
    sides = [_cross(triangle[i - 2] - triangle[i], others - triangle[i]) for i in range(3)]
    inside = (np.stack(sides) >= -none).all(axis=0)
    # A corner that lies exactly on a corner of the ear (a polygon with a bridge to its hole) is no obstacle.
    same = (np.abs(others[:, None] - triangle) == 0).all(axis=-1).any(axis=1)
    return not (inside & ~same).any()
