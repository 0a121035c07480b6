"""Signatures of histograms of orientations (SHOT), for the vertices of a mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from csm._types import FloatArray, IntArray
from csm.descriptors.acd import unit_rows
from csm.descriptors.base import Descriptor, Features
from csm.operators.operators import Operators

SECTORS = 8
"""Azimuth sectors; with two elevations and two radii they make 32 volumes."""

PAIRS_AT_ONCE = 400_000
"""How many pairs of a vertex and a neighbour are held in memory together, some 100 MB."""


@dataclass(frozen=True)
class SHOT(Descriptor):
    r"""Histograms of normals in 32 volumes of a ball around each vertex, laid out along a local frame.

    The frame of vertex p has the eigenvectors of  sum (R - d_i) (p_i - p)(p_i - p)^T  over its neighbours p_i at
    distance d_i <= R: X of the largest and Z of the smallest eigenvalue, each turned to the side where most neighbours
    are, and Y = Z x X.  The ball has 8 azimuths x 2 radii (split at R / 2) x 2 elevations, and each volume a histogram
    of the cosine between Z and the neighbours' normals.  A neighbour gives its own bin the sum of four weights that
    fall linearly with the distance from the bin's centre along cosine, radius, elevation and azimuth, and gives the
    rest of each to the next bin along that axis (nothing where there is none).  Rows have unit length.

    Parameters
    ----------
    radius
        R, as a fraction of the square root of the surface area.
    bins
        Intervals of the cosine; each histogram has one bin more, so there are 32 (bins + 1) columns.
    min_neighbours
        A vertex with fewer neighbours has a row of zeros.  A guess: users of the public code ask for 3, but its frame
        refuses fewer than 5 whatever is asked.
    area_weighted
        Weigh each neighbour by its vertex area, in the frame and in the histograms, so that the density of vertices
        plays no part.  Off in every published use.

    Raises
    ------
    ConfigError
        If `radius` is not positive, or `bins` or `min_neighbours` is below 1.

    Notes
    -----
    Extrinsic: it depends on the pose.  Where the two largest eigenvalues are equal, as on a sphere, the frame is
    arbitrary.  A mirror image has the same rows with the azimuth sectors in reverse order.

    At a tie between the two sides of an axis (one vertex in forty of a body), their mean decides; the public code then
    keeps the eigensolver's sign, so depends on the world axes.  Normals are area-weighted means of face normals.
    Azimuth wraps after all 8 sectors and the cosine not at all; the public code wraps both at a size that is too
    small, and so counts some neighbours towards an unrelated bin.

    References
    ----------
    Tombari, Salti, Di Stefano, "Unique signatures of histograms for local surface description", ECCV 2010; the radius
    and 10 bins are those of the code that functional-map publications share.

    Examples
    --------
    >>> len(SHOT().columns), SHOT().columns[0]
    (352, 'azimuth=-157.5 inner below cos=-1')
    """

    radius: float = 0.06
    bins: int = 10
    min_neighbours: int = 5
    area_weighted: bool = False

    name: ClassVar[str] = "shot"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(1, "bins", "min_neighbours")
        self.require(self.radius > 0, "radius", "a number above 0")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the 32 (bins + 1) columns."""
        azimuths = -180 + (np.arange(SECTORS) + 0.5) * (360 / SECTORS)
        cosines = np.linspace(-1, 1, self.bins + 1)
        bins = product(azimuths, ("inner", "outer"), ("below", "above"), cosines)
        return tuple(f"azimuth={azimuth:.1f} {ring} {side} cos={c:.3g}" for azimuth, ring, side, c in bins)

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, 32 (bins + 1)), without unit."""
        mesh = operators.mesh
        areas = operators.mass if self.area_weighted else np.ones(mesh.n_vertices)
        values = np.zeros((mesh.n_vertices, len(self.columns)))
        normals = mesh.vertex_normals
        radius = self.radius * float(np.sqrt(mesh.area))
        for ball in balls(mesh.vertices, radius, self.min_neighbours):
            weights = areas[ball.neighbours]
            axes = local_frames(ball, weights, radius)[ball.owners]
            position = np.einsum("pi,pij->pj", ball.offsets, axes)
            cosine = np.einsum("pi,pi->p", normals[ball.neighbours], axes[:, :, 2])
            votes = _votes(position, cosine, ball.distances / radius, self.bins)
            cells = ball.owners * values.shape[1] + votes.columns
            counted = np.bincount(cells.ravel(), (weights * votes.shares).ravel(), values[ball.vertices].size)
            values[ball.vertices] = counted.reshape(-1, values.shape[1])
        return Features(unit_rows(values), self.columns)


class Balls(NamedTuple):
    """The neighbourhoods of some vertices, as P pairs.

    `vertices` (V,) are the vertices; per pair, `owners` (P,) says whose it is (0 .. V - 1), `neighbours` (P,) which
    vertex the neighbour is, `offsets` (P, 3) and `distances` (P,) where it is from the owner.
    """

    vertices: IntArray
    owners: IntArray
    neighbours: IntArray
    offsets: FloatArray
    distances: FloatArray


def balls(points: FloatArray, radius: float, least: int) -> Iterator[Balls]:
    """Yield the other points within `radius` of each point that has at least `least` of them, a block at a time.

    Points in the very same place are not neighbours.
    """
    tree = cKDTree(points)
    count = tree.query_ball_point(points, radius, return_length=True)
    blocks = np.cumsum(count) // PAIRS_AT_ONCE
    for block in np.split(np.arange(len(points)), np.flatnonzero(np.diff(blocks)) + 1):
        pairs = cKDTree(points[block]).sparse_distance_matrix(tree, radius, output_type="ndarray")
        pairs = pairs[pairs["v"] > 0]
        crowded = np.bincount(pairs["i"], minlength=len(block)) >= least
        pairs = pairs[crowded[pairs["i"]]]
        owners, neighbours = (np.cumsum(crowded) - 1)[pairs["i"]], pairs["j"].astype(np.int64)
        vertices = block[crowded]
        yield Balls(vertices, owners, neighbours, points[neighbours] - points[vertices[owners]], pairs["v"])


def local_frames(ball: Balls, weights: FloatArray, radius: float) -> FloatArray:
    """Return a frame for each vertex, (V, 3, 3), whose columns are X, Y, Z; weights (P,) are of the neighbours."""
    n = len(ball.vertices)
    pull = weights * (radius - ball.distances)
    upper = [
        np.bincount(ball.owners, pull * ball.offsets[:, i] * ball.offsets[:, j], n)
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    ]
    spread = np.stack(upper, axis=1)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(n, 3, 3)
    vectors = np.linalg.eigh(spread)[1]
    x, z = (_to_the_many(vectors[:, :, k], ball, weights) for k in (2, 0))
    return np.stack([x, np.cross(z, x), z], axis=2)


def _to_the_many(axis: FloatArray, ball: Balls, weights: FloatArray) -> FloatArray:
    """Turn each axis (V, 3) to the side where most neighbours, by weight, are; at a tie to where their mean is."""
    along = np.einsum("pi,pi->p", ball.offsets, axis[ball.owners])
    balance = np.bincount(ball.owners, np.where(along >= 0, weights, -weights), len(axis))
    mean = np.bincount(ball.owners, weights * along, len(axis))
    return np.where(np.where(balance == 0, mean, balance) >= 0, 1.0, -1.0)[:, None] * axis


class _Votes(NamedTuple):
    """Columns (5, P) that each neighbour counts towards, its own first, and how much (5, P)."""

    columns: IntArray
    shares: FloatArray


def _votes(position: FloatArray, cosine: FloatArray, distance: FloatArray, bins: int) -> _Votes:
    """Spread neighbours at places (P, 3) of the frame, at distances (P,) over R, over their bins along four axes.

    Along each axis the bin centres are whole numbers from 0 on; `cosine` (P,) is that of a normal with Z.
    """
    x, y, z = position.T
    azimuth = (np.arctan2(y, x) / (2 * np.pi) + 0.5) * SECTORS - 0.5
    side = 1.5 - np.arccos(np.clip(z / np.linalg.norm(position, axis=1), -1, 1)) / (np.pi / 2)
    at = np.stack([azimuth, 2 * distance - 0.5, side, np.clip((cosine + 1) / 2, 0, 1) * bins])
    sizes = np.array([[SECTORS], [2], [2], [bins + 1]])
    strides = np.array([[4 * (bins + 1)], [2 * (bins + 1)], [bins + 1], [1]])
    own = np.clip(np.floor(at + 0.5).astype(np.int64), 0, sizes - 1)
    rest = at - own
    after = own + np.sign(rest).astype(np.int64)
    after[0] %= SECTORS
    exists = (after >= 0) & (after < sizes)
    home = (own * strides).sum(axis=0)
    columns = home + np.where(exists, after - own, 0) * strides
    shares = np.abs(rest)
    return _Votes(np.vstack([home, columns]), np.vstack([(1 - shares).sum(axis=0), np.where(exists, shares, 0)]))
