"""What can be known of a map without ground truth, vertex by vertex: the evidence that confidence is computed from.

Distances are through space, in units of the square root of the area of the shape that they are on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from csm._types import FloatArray, IntArray
from csm.matching.base import Described
from csm.matching.embedded import Embedded
from csm.matching.functional import functional_map
from csm.matching.maps import VertexMap
from csm.matching.rows import as_array
from csm.mesh.debris import body_of
from csm.mesh.shape import Mesh

NEAR = 0.1
"""Distance, in units of the square root of the area, from which a vertex counts as having gone elsewhere."""

SAMPLES = 1000
"""Vertices spread over the source; what is around a vertex is known at the nearest of them."""

_AROUND = 20
_FAR = 100  # samples that a vertex's distances to all parts of the shape are measured to
_FINE = 60  # eigenfunctions of these distances
_JUDGED = 100  # eigenfunctions of the functional map that is judged
_STRETCH = 0.02  # lengths below this are noise of the triangulation

OF_MAPS = ("back", "descriptor", "local", "back_all", "descriptor_all", "local_all")
"""Names of the signals of any map, see `map_signals`."""

OF_REFINED = ("start", "apart", "start_all", "apart_all", "stretch", "commutation")
"""Names of those that a refined map has besides, see `spectral_signals`."""


@dataclass(frozen=True, eq=False)
class Sides:
    """Two described shapes and the maps between them, -1 where a vertex has no partner.

    Parameters
    ----------
    source, target
        The shapes.
    forward, backward
        The maps source -> target and target -> source.
    """

    source: Described
    target: Described
    forward: VertexMap
    backward: VertexMap


def map_signals(sides: Sides) -> FloatArray:
    """Return the signals `OF_MAPS` of every vertex of the source, shape (N_source, 6).

    *back*: from a vertex to where it returns on the way there and back.  *descriptor*: root mean squared distance of
    the descriptors of vertex and partner around the vertex, over the spread of the target's.  *local*: median of the
    absolute logarithm of how the map stretches the ways to the 20 nearest of 1,000 samples.  The three others are their
    medians over the shape.  Vertices without a partner have the values of the partner 0, and mean nothing.
    """
    there, back = sides.forward.indices, sides.backward.indices
    here = _unit(sides.source.mesh)
    away = np.linalg.norm(here[back[there]] - here, axis=1)
    around = _Around(sides)
    apart = np.sqrt((_descriptor_gaps(sides)[around.at] ** 2)[around.nearest].mean(1))
    local = around.stretch()
    each = np.stack([away, apart, local], axis=1)
    found: FloatArray = np.hstack([each, np.tile(np.median(each, axis=0), (len(each), 1))])
    return found


def spectral_signals(sides: Sides, start: VertexMap) -> FloatArray:
    """Return the signals `OF_REFINED` of every vertex of the source, shape (N_source, 6).

    `start` needs entries at the first `SAMPLES` of the source's order only.

    *start*: agreement, from 0 to 1, of the map with the nearest neighbours that it was refined from, around the vertex.
    *apart*: median over 100 samples of how much the biharmonic distance to them (Lipman et al. 2010) changes under the
    map, over the mean distance.  Their mean and median over the shape; and *stretch* and *commutation* of
    `csm.matching.judging.judged`.
    """
    there = sides.forward.indices
    around, points = _Around(sides), _unit(sides.target.mesh)
    apart_there = points[start.indices[around.at]] - points[there[around.at]]
    near = np.exp(-((np.linalg.norm(apart_there, axis=1) / NEAR) ** 2))[around.nearest].mean(1)
    apart = _biharmonic_changes(sides.source.embedded, sides.target.embedded, there)
    whole = np.array([near.mean(), np.median(apart), *_judged(sides)])
    return np.hstack([np.stack([near, apart], axis=1), np.tile(whole, (len(near), 1))])


def _unit(mesh: Mesh) -> FloatArray:
    """Return the vertices in units of the square root of the area of the body."""
    return mesh.vertices / float(np.sqrt(body_of(mesh).area))


class _Around:
    """Samples of the source, and for each vertex the nearest of them."""

    def __init__(self, sides: Sides) -> None:
        self.here, self.points = _unit(sides.source.mesh), _unit(sides.target.mesh)[sides.forward.indices]
        self.at = sides.source.order[:SAMPLES]
        k = np.arange(1, min(_AROUND, len(self.at)) + 1)
        self.nearest: IntArray = np.asarray(cKDTree(self.here[self.at]).query(self.here, k=k)[1], dtype=np.int64)

    def stretch(self) -> FloatArray:
        """Return the median absolute logarithm of the stretch of the ways from each vertex to the samples around it."""
        others = self.at[self.nearest]
        before = np.linalg.norm(self.here[others] - self.here[:, None], axis=2)
        after = np.linalg.norm(self.points[others] - self.points[:, None], axis=2)
        median: FloatArray = np.median(np.abs(np.log((after + _STRETCH) / (before + _STRETCH))), axis=1)
        return median


def _descriptor_gaps(sides: Sides) -> FloatArray:
    """Return the distance of each vertex's descriptor from its partner's, over the spread of the target's."""
    here, there = as_array(sides.source.rows), as_array(sides.target.rows)
    spread = np.sqrt(((there - there.mean(0)) ** 2).sum(1).mean())
    gaps = np.linalg.norm(here - there[sides.forward.indices], axis=1)
    found: FloatArray = gaps.astype(np.float64) / max(float(spread), float(np.finfo(np.float32).tiny))
    return found


def _biharmonic_changes(source: Embedded, target: Embedded, there: IntArray) -> FloatArray:
    here, images = _biharmonic(source), _biharmonic(target)[there]
    far = source.samples(_FAR).at
    before, after = cdist(here, here[far]), cdist(images, images[far])
    changes: FloatArray = np.median(np.abs(before - after), axis=1) / max(float(before.mean()), 1e-300)
    return changes


def _biharmonic(shape: Embedded) -> FloatArray:
    """Return points (N, K) whose distances are the biharmonic ones of the smooth part of the spectrum."""
    evals, evecs = shape.spectrum.evals[:_FINE], shape.spectrum.evecs[:, :_FINE]
    moving = evals > 0
    points: FloatArray = evecs[:, moving] / evals[moving]
    return points


def _judged(sides: Sides) -> tuple[float, float]:
    """Return how much the functional map of the map stretches areas, and how little it commutes with the Laplacians."""
    import torch

    from csm.matching.judging import judged

    here, there = sides.source.embedded.spectrum, sides.target.embedded.spectrum
    k = min(_JUDGED, len(here.evals), len(there.evals))
    c = torch.from_numpy(functional_map(sides.forward.indices, here, there, k))
    evals = (torch.from_numpy(spectrum.evals[:k]) for spectrum in (here, there))
    stretch, commutation = judged(c[None], *evals)
    return float(stretch), float(commutation)
