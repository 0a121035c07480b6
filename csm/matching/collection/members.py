"""The shapes of a collection as tasks carry them to other processes, and what is computed there pair by pair."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from csm._types import Float32Array, FloatArray, IntArray
from csm.data.store import Store
from csm.matching.base import Described
from csm.matching.collection.candidates import Candidates, judge, search
from csm.matching.collection.climb import finer
from csm.matching.embedded import Embedded
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import RefinedMap
from csm.matching.refinement.joint import Climb, finished
from csm.matching.refinement.multistart import Multistart
from csm.matching.refinement.pair import Pair
from csm.mesh.shape import Mesh

_KEPT = 16  # embedded shapes that a process keeps; one of 7,000 vertices takes about 25 MB
_recent: OrderedDict[tuple[str, str, str], Embedded] = OrderedDict()


@dataclass(frozen=True, eq=False)
class Member:
    """One shape of a collection: all that is computed of it is its features; eigenpairs are found in the store.

    Parameters
    ----------
    mesh
        The cleaned mesh.
    features
        Shape (N, Q), its description.
    root
        Folder of the store.
    device
        Where maps are computed.
    """

    mesh: Mesh
    features: Float32Array
    root: Path
    device: str = "cpu"

    def described(self) -> Described:
        """Return the shape as matchers take it; its eigenfunctions are kept for the next call, with those of few."""
        found = Described(self.mesh, torch.from_numpy(self.features).to(self.device), store=Store(self.root))
        key = (self.mesh.digest, str(self.root), self.device)
        if key in _recent:
            found.__dict__["embedded"] = _recent[key]
        _recent[key] = found.embedded
        _recent.move_to_end(key)
        while len(_recent) > _KEPT:
            _recent.popitem(last=False)
        return found


@dataclass(frozen=True, eq=False)
class EdgeTask:
    """A pair to find candidates for: by a search, or by refining maps (c, K, K) that are given."""

    source: Member
    target: Member
    refiner: Multistart
    k: int
    maps: FloatArray | None = None

    def label_of(self) -> str:
        """Return the pair, for progress bars."""
        return f"{self.source.mesh.name} - {self.target.mesh.name}"

    def pair(self) -> Pair:
        """Return the two shapes side by side."""
        return Pair.of(self.source.described(), self.target.described())


def candidates_of(task: EdgeTask) -> Candidates:
    """Return the candidates for the map of a pair."""
    if task.maps is None:
        return search(task.pair(), task.refiner, task.k)
    return judge(task.maps, task.pair(), task.refiner, task.k)


def finer_map(task: EdgeTask) -> FloatArray:
    """Return the first of the task's maps at the task's size, see `csm.matching.collection.climb.finer`."""
    assert task.maps is not None
    return finer(task.maps[0], task.pair(), task.refiner.climb, task.k)


def finest(matrix: FloatArray, pair: Pair, climb: Climb, text: str = "") -> RefinedMap:
    """Return the maps of all vertices in both directions, by a climb from a functional map (K, K)."""
    names, k = (pair.source.mesh.name, pair.target.mesh.name), len(matrix)
    climb = replace(climb, schedule=tuple(size for size in climb.schedule if size >= k) or (k,))
    start = VertexMap(np.zeros(0, dtype=np.int64), pair.target.mesh.n_vertices, *names)
    given = torch.from_numpy(np.ascontiguousarray(matrix)).float().to(pair.source.device)
    return finished(climb(given, pair), pair, climb, start, text)


def both_maps(task: EdgeTask) -> tuple[IntArray, IntArray]:
    """Return the vertex maps there and back of the first of the task's maps."""
    assert task.maps is not None
    found = finest(task.maps[0], task.pair(), task.refiner.climb)
    assert found.backward is not None
    return found.forward.vertex_map.indices, found.backward.vertex_map.indices
