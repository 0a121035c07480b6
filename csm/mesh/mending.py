"""Single repairs of triangle meshes, as functions of arrays that say what to join, cut, turn or leave out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.topology import components, edge_keys


class Sides(NamedTuple):
    """The half-edges of M faces, side by side: number s M + f is side s of face f.

    Shapes (3 M,): `tails` and `heads`, the number `edge` of the undirected edge, and how many faces it has (`uses`).
    """

    tails: IntArray
    heads: IntArray
    edge: IntArray
    uses: IntArray


def sides(faces: IntArray, n: int) -> Sides:
    """Return the half-edges of faces, shape (M, 3), among `n` vertices."""
    tails, heads = faces.T.ravel(), faces[:, [1, 2, 0]].T.ravel()
    edge = np.unique(edge_keys(tails, heads, n), return_inverse=True)[1].ravel()
    return Sides(tails, heads, edge, np.bincount(edge, minlength=1)[edge])


def welded(vertices: FloatArray, faces: IntArray, tolerance: float) -> IntArray:
    """Return for each vertex the first one that it is welded to, itself if to none; shape (N,).

    Boundary edges that run between the same places are joined, and their ends with them.  Parts that merely touch in a
    vertex, or away from boundaries, are not joined: they would have to be cut apart again.

    Parameters
    ----------
    vertices, faces
        Shapes (N, 3) and (M, 3).
    tolerance
        What counts as the same place, as a fraction of the diagonal of the bounding box.
    """
    side = sides(faces, len(vertices))
    border = np.flatnonzero((side.uses == 1) & (side.tails != side.heads))
    tails, heads = side.tails[border], side.heads[border]
    place = _places(vertices, np.unique(np.concatenate([tails, heads])), tolerance)
    turned = place[tails] > place[heads]
    starts, ends = np.where(turned, heads, tails), np.where(turned, tails, heads)
    keys = edge_keys(place[starts], place[ends], len(vertices))
    order = np.argsort(keys, kind="stable")
    within = place[starts] == place[ends]  # an edge within one place vanishes, and faces of nothing else with it
    order = order[~within[order]]
    same = np.flatnonzero(np.diff(keys[order]) == 0)
    a, b = order[same], order[same + 1]
    one, other = np.r_[starts[a], ends[a], starts[within]], np.r_[starts[b], ends[b], ends[within]]
    group = components(one, other, len(vertices))
    return np.unique(group, return_index=True)[1][group]


def _places(vertices: FloatArray, border: IntArray, tolerance: float) -> IntArray:
    """Return for each vertex of a boundary the first such vertex at the same place, else itself; shape (N,)."""
    first = np.arange(len(vertices))
    border = border[np.isfinite(vertices[border]).all(axis=1)]
    if border.size == 0:
        return first
    places = vertices[border]
    reach = tolerance * float(np.linalg.norm(np.ptp(places, axis=0)))
    pairs = cKDTree(places).query_pairs(reach, output_type="ndarray") if reach > 0 else np.zeros((0, 2), np.int64)
    _, exact = np.unique(places, axis=0, return_inverse=True)
    by_place = np.argsort(exact.ravel(), kind="stable")
    same = np.flatnonzero(np.diff(exact.ravel()[by_place]) == 0)
    a = np.concatenate([pairs[:, 0], by_place[same]])
    b = np.concatenate([pairs[:, 1], by_place[same + 1]])
    group = components(a, b, len(border))
    first[border] = border[np.unique(group, return_index=True)[1]][group]
    return first


NO_LENGTH = 1e-9
"""An edge shorter than this fraction of the bounding box's diagonal has no length."""


def joined_short_edges(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return for each vertex the first of those that edges of no length (`NO_LENGTH`) join it with; shape (N,)."""
    tails, heads = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    diagonal = float(np.linalg.norm(np.ptp(vertices[np.unique(faces)], axis=0))) if faces.size else 0.0
    short = np.linalg.norm(vertices[tails] - vertices[heads], axis=1) <= NO_LENGTH * diagonal
    group = components(tails[short], heads[short], len(vertices))
    return np.unique(group, return_index=True)[1][group]


def sound_faces(faces: IntArray) -> BoolArray:
    """Return which faces, (M,), have three different corners and do not repeat an earlier face, in whatever order."""
    a, b, c = faces.T
    sound: BoolArray = (a != b) & (b != c) & (c != a)
    ordered = np.sort(faces, axis=1)
    first = np.zeros(len(faces), dtype=bool)
    first[np.unique(ordered, axis=0, return_index=True)[1]] = True
    return sound & first


def collapsed(vertices: FloatArray, faces: IntArray, flat: BoolArray) -> IntArray:
    """Return for each vertex that only `flat` faces, (M,), touch its nearest neighbour, else itself; shape (N,)."""
    target = np.arange(len(vertices))
    alive = np.zeros(len(vertices), dtype=bool)
    alive[faces[~flat]] = True
    dead = np.zeros(len(vertices), dtype=bool)
    dead[faces[flat]] = True
    dead &= ~alive
    tails = np.concatenate([faces.ravel(), faces[:, [1, 2, 0]].ravel()])
    heads = np.concatenate([faces[:, [1, 2, 0]].ravel(), faces.ravel()])
    wanted = dead[tails] & (tails != heads)
    tails, heads = tails[wanted], heads[wanted]
    length = np.linalg.norm(vertices[tails] - vertices[heads], axis=1)
    order = np.lexsort((length, ~alive[heads], tails))  # a living neighbour first, then the nearest
    lone, first = np.unique(tails[order], return_index=True)
    best = heads[order][first]
    ok = alive[best]
    target[lone[ok]] = best[ok]
    return target


class Split(NamedTuple):
    """Faces, shape (M, 3), of which every vertex has one fan, and the old vertex of each new one, shape (N_new,)."""

    faces: IntArray
    origin: IntArray


def split(vertices: FloatArray, faces: IntArray) -> Split:
    """Cut a surface so that it is a manifold: at edges of more than two faces, and vertices of several fans.

    At such an edge faces stay joined in pairs: those that are oriented alike first, then the flattest.  The largest fan
    keeps the number of its vertex, the others get new vertices after the old ones.
    """
    n, m = len(vertices), len(faces)
    side = sides(faces, n)
    proper = side.tails != side.heads
    half = np.argsort(side.edge, kind="stable")
    half = half[proper[half] & (side.uses[half] == 2)]
    a, b = half[0::2], half[1::2]
    crowded = np.flatnonzero(proper & (side.uses > 2))
    more = _paired(vertices, faces, side, crowded)
    a, b = np.concatenate([a, more[:, 0]]), np.concatenate([b, more[:, 1]])
    after = (np.arange(3 * m) + m) % (3 * m)  # the corner at the head of a half-edge, in the same face
    alike = side.tails[a] == side.tails[b]
    rows = np.concatenate([a, after[a]])
    columns = np.concatenate([np.where(alike, b, after[b]), np.where(alike, after[b], b)])
    fan = components(rows, columns, 3 * m)
    n_fans = int(fan.max(initial=-1)) + 1
    size = np.bincount(fan, minlength=n_fans)
    owner = np.zeros(n_fans, dtype=np.int64)
    owner[fan] = side.tails
    order = np.lexsort((-size, owner))
    first = np.ones(n_fans, dtype=bool)
    first[1:] = np.diff(owner[order]) != 0
    number = np.empty(n_fans, dtype=np.int64)
    number[order[first]] = owner[order[first]]
    extra = np.sort(order[~first])
    number[extra] = n + np.arange(len(extra))
    new = number[fan].reshape(3, m).T
    return Split(np.ascontiguousarray(new), np.concatenate([np.arange(n), owner[extra]]))


def _paired(vertices: FloatArray, faces: IntArray, side: Sides, crowded: IntArray) -> IntArray:
    """Return which half-edges of crowded edges stay joined, shape (P, 2)."""
    m = len(faces)
    pairs: list[tuple[int, int]] = []
    for edge in np.unique(side.edge[crowded]):
        here = crowded[side.edge[crowded] == edge]
        along = vertices[side.heads[here]] - vertices[side.tails[here]]
        inward = vertices[faces[here % m, (here // m + 2) % 3]] - vertices[side.tails[here]]
        length = np.maximum((along**2).sum(axis=1, keepdims=True), np.finfo(np.float64).tiny)
        inward = inward - along * (inward * along).sum(axis=1, keepdims=True) / length
        inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        i, j = np.triu_indices(len(here), 1)
        against = side.tails[here[i]] == side.tails[here[j]]
        free = np.ones(len(here), dtype=bool)
        for p in np.lexsort(((inward[i] * inward[j]).sum(axis=1), against)):
            if free[i[p]] and free[j[p]]:
                free[[i[p], j[p]]] = False
                pairs.append((int(here[i[p]]), int(here[j[p]])))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


class Turns(NamedTuple):
    """Which faces to turn, shape (M,), how many components are one-sided, and how many were inside out as a whole."""

    flip: BoolArray
    n_one_sided: int
    n_inside_out: int


def turns(vertices: FloatArray, faces: IntArray) -> Turns:
    """Return which faces to turn so that neighbours agree and closed components have a positive volume.

    Of an open component the side with more area stays as it is, unless it is closed but for small holes.  A component
    that lies within another one may be a cavity, and stays.  A one-sided component (a Moebius strip) stays too.
    """
    m, n = len(faces), len(vertices)
    flip = np.zeros(m, dtype=bool)
    if m == 0:
        return Turns(flip, 0, 0)
    side = sides(faces, n)
    proper = side.tails != side.heads
    half = np.argsort(side.edge, kind="stable")
    half = half[proper[half] & (side.uses[half] == 2)]
    a, b = half[0::2], half[1::2]
    against = side.tails[a] == side.tails[b]
    f, g = a % m, b % m
    # Each face stands twice, as it is (f) and turned (f + m); neighbours that agree are joined.
    rows = np.concatenate([f, f + m])
    columns = np.concatenate([np.where(against, g + m, g), np.where(against, g, g + m)])
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(2 * m, 2 * m))
    state = connected_components(graph, directed=False)[1].astype(np.int64)
    one_sided = state[:m] == state[m:]
    part = components(f, g, m)
    crosses = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    areas = np.linalg.norm(crosses, axis=1) / 2
    flip = _less_area(part, state, areas) & ~one_sided
    inside_out = _inside_out(vertices, faces, part, np.where(flip, -1.0, 1.0)[:, None] * crosses, side)
    inside_out[part[one_sided]] = False
    return Turns(flip ^ inside_out[part], len(np.unique(part[one_sided])), int(inside_out.sum()))


def _less_area(part: IntArray, state: IntArray, areas: FloatArray) -> BoolArray:
    """Return the faces, (M,), on the smaller of the two sides of their component."""
    m = len(part)
    lead = np.full(int(part.max()) + 1, -1, dtype=np.int64)
    lead[part[::-1]] = state[:m][::-1]  # the state of the first face of each component
    turned = state[:m] != lead[part]
    sums = [np.bincount(part[turned == side], areas[turned == side], minlength=len(lead)) for side in (False, True)]
    swap = sums[1] > sums[0]
    less: BoolArray = turned ^ swap[part]
    return less


def _inside_out(vertices: FloatArray, faces: IntArray, part: IntArray, crosses: FloatArray, side: Sides) -> BoolArray:
    """Return for each component whether it is closed (or nearly) and its faces are oriented inwards."""
    m, n_parts = len(faces), int(part.max()) + 1
    corners = vertices[faces]
    areas = np.bincount(part, np.linalg.norm(crosses, axis=1) / 2, minlength=n_parts)
    border = np.flatnonzero((side.uses == 1) & (side.tails != side.heads))
    lengths = np.linalg.norm(vertices[side.heads[border]] - vertices[side.tails[border]], axis=1)
    rim = np.bincount(part[border % m], lengths, minlength=n_parts)
    counts = np.bincount(part, minlength=n_parts)
    middles = corners.mean(axis=1)
    centre = np.stack([np.bincount(part, middles[:, i], minlength=n_parts) / counts for i in range(3)], axis=1)
    volume = np.bincount(part, ((corners[:, 0] - centre[part]) * crosses).sum(axis=1) / 6, minlength=n_parts)
    closed = rim <= 0.5 * np.sqrt(areas)
    inside: BoolArray = closed & (volume < -0.002 * areas**1.5)
    if n_parts > 1 and inside.any():
        low, high = np.full((n_parts, 3), np.inf), np.full((n_parts, 3), -np.inf)
        np.minimum.at(low, part, corners.min(axis=1))
        np.maximum.at(high, part, corners.max(axis=1))
        for p in np.flatnonzero(inside):
            within = (low < low[p]).all(axis=1) & (high > high[p]).all(axis=1) & (areas > areas[p])
            inside[p] = not within.any()
    return inside
