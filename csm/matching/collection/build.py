"""Matching a collection of shapes in one call."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import shortest_path

from csm._parallel import parallel_map
from csm._types import Float32Array, FloatArray, IntArray
from csm.data.store import Store
from csm.descriptors.base import Descriptor
from csm.errors import ConfigError
from csm.matching.base import Described, require_device
from csm.matching.collection.candidates import Candidates, joined, stacked
from csm.matching.collection.climb import SIZES, consistent
from csm.matching.collection.graph import pairs_of
from csm.matching.collection.members import EdgeTask, Member, candidates_of, finer_map
from csm.matching.collection.result import Cycles, Edge, MatchedCollection
from csm.matching.collection.shapes import Shapes, named_shapes, require_names
from csm.matching.collection.synchronise import SCALE, Agreement, agree, apart, composed, triangle_errors
from csm.matching.embedded import n_eigenfunctions
from csm.matching.methods import DescriptorMethod, Method, PrecomputedMethod, as_method
from csm.matching.refinement.multistart import Multistart
from csm.matching.subjects import Cleaning, Subject, subject_of
from csm.mesh.shape import Mesh

COMPLETE = 12
"""Up to so many shapes, every pair is matched by itself."""

MENDED = 0.4
"""Distance of a pair's own map from the agreement, from which on it counts as another map, which was mended."""


def match_collection(
    shapes: Shapes,
    method: Method | Descriptor | str = "acd",
    *,
    refiner: Multistart | None = None,
    near: int = 6,
    far: int = 2,
    clean: Cleaning = "auto",
    store: Store | str | os.PathLike[str] | None = None,
    device: str = "cpu",
    workers: int | None = None,
    progress: bool = True,
) -> MatchedCollection:
    """Match a collection of shapes so that maps agree around cycles; this is ``csm.match_collection``.

    A pair by itself may end with limbs exchanged.  Here some pairs are matched by several starts each, all of whose
    ends are kept; of these the ones are chosen with which cycles of shapes close, the functional maps are made to close
    every cycle exactly (`csm.matching.collection.synchronise`), what they say of each doubtful pair is refined and
    judged beside its own candidates, and the choice is made once more.  All maps then become finer together
    (`csm.matching.collection.climb`).

    Parameters
    ----------
    shapes
        A folder of meshes, or two or more meshes with different names.
    method
        A descriptor, the name of a preset, or a trained network of `csm.load_model`.
    refiner
        The search of each pair; by default that of `csm.match`.
    near, far
        Of more than 12 shapes, how many most alike ones and how many others each is matched with by itself.
    clean, store, device
        As of `csm.match`.
    workers
        Processes of one thread; by default one per core, where that pays.
    progress
        Show progress bars.

    Returns
    -------
    MatchedCollection
        Maps of any two shapes, made when they are asked for.

    Raises
    ------
    ConfigError, DataError, MeshError
        If there are fewer than two shapes, two have one name, or one of them cannot be used.
    """
    refiner, chosen = refiner or Multistart(), as_method(method)
    store = store if isinstance(store, Store) else Store(store)
    require_device(device)
    if isinstance(chosen, PrecomputedMethod):
        clean = "off"
    subjects = tuple(subject_of(mesh, clean, name) for name, mesh in named_shapes(shapes).items())
    require_names(subjects)
    run = _Run(workers if device == "cpu" else 0, progress)
    members = _described(subjects, chosen, store, device, run)
    return _matched(subjects, members, chosen, refiner, _graph(members, near, far), run)


def _matched(
    subjects: tuple[Subject, ...],
    members: tuple[Member, ...],
    method: Method,
    refiner: Multistart,
    pairs: IntArray,
    run: _Run,
) -> MatchedCollection:
    """Match the pairs of described shapes and make their maps agree."""
    n = len(members)
    alone, both, agreement = _candidates(members, pairs, refiner, run)
    each, best = np.arange(len(pairs)), alone.costs.argmin(1)
    cycles = Cycles(
        triangle_errors(alone.maps[each, best], pairs, n)[1],
        triangle_errors(both.maps[each, agreement.choice], pairs, n)[1],
    )
    bases = _finer(members, agreement.bases, pairs, refiner, run)
    edges = _edges(alone, agreement, pairs, [subject.given.name for subject in subjects])
    middle = medoid(pairs, both.costs[each, agreement.choice] + agreement.apart, n)
    return MatchedCollection(subjects, members, bases, edges, cycles, method, refiner, middle)


@dataclass(frozen=True)
class _Run:
    """How tasks are run."""

    workers: int | None
    progress: bool

    def __call__(self, function: Any, tasks: Sequence[Any], label: Any, what: str, unit: str) -> list[Any]:
        return parallel_map(function, tasks, label, self.workers, what=what, unit=unit, progress=self.progress)


@dataclass(frozen=True, eq=False)
class _Preparation:
    mesh: Mesh
    method: DescriptorMethod | None
    root: Path


def _prepared(task: _Preparation) -> Float32Array | None:
    """Put the eigenpairs of a mesh into the store, and return its descriptor."""
    store = Store(task.root)
    Described(task.mesh, np.zeros((0, 0)), store=store).spectrum(n_eigenfunctions(task.mesh))
    return None if task.method is None else task.method.describe(task.mesh, store).values


def _described(subjects: Sequence[Subject], method: Method, store: Store, device: str, run: _Run) -> tuple[Member, ...]:
    """Describe all shapes: descriptors where there is room, networks and given features in this process."""
    portable = method if isinstance(method, DescriptorMethod) else None
    meshes = [subject.cleaned.mesh for subject in subjects]
    tasks = [_Preparation(mesh, portable, store.root) for mesh in meshes]
    rows = run(_prepared, tasks, _name, "describe", "shape")
    if portable is None:
        rows = [method.describe(mesh, store, device).values for mesh in meshes]
    return tuple(Member(mesh, found, store.root, device) for mesh, found in zip(meshes, rows, strict=True))


def _name(task: _Preparation) -> str:
    return task.mesh.name


def unlikeness(features: Sequence[Float32Array]) -> FloatArray:
    """Return how unlike shapes are, (n, n): distances of the means and spreads of their features.

    Examples
    --------
    >>> unlikeness([np.zeros((5, 1)), np.zeros((9, 1)), np.ones((5, 1))])[0]
    array([0., 0., 1.])
    """
    widths = {rows.shape[1] for rows in features}
    if len(widths) > 1:
        raise ConfigError(f"descriptors of {' and '.join(map(str, sorted(widths)))} columns; wanted the same of all")
    moments = np.array([np.concatenate([rows.mean(0), rows.std(0)]) for rows in features], dtype=np.float64)
    return np.asarray(np.linalg.norm(moments[:, None] - moments[None], axis=-1))


def _graph(members: Sequence[Member], near: int, far: int) -> IntArray:
    n = len(members)
    distances = unlikeness([member.features for member in members])
    return pairs_of(distances, n if n <= COMPLETE else near, far)


def _candidates(
    members: Sequence[Member], pairs: IntArray, refiner: Multistart, run: _Run
) -> tuple[Candidates, Candidates, Agreement]:
    """Return candidates of the edges, by searches and of what the others say, and what they agree on in the end."""
    k = min(refiner.climb.sizes(n_eigenfunctions(member.mesh))[0] for member in members)
    tasks = [EdgeTask(members[i], members[j], refiner, k) for i, j in pairs]
    alone = stacked(run(candidates_of, tasks, EdgeTask.label_of, "match", "pair"))
    first = agree(alone.maps, alone.costs, pairs, len(members))
    doubtful = np.flatnonzero(first.apart > SCALE)
    said = composed(first.bases, pairs[doubtful])
    again = [replace(tasks[e], maps=one[None]) for e, one in zip(doubtful, said, strict=True)]
    judged = run(candidates_of, again, EdgeTask.label_of, "mend", "pair") if again else []
    more = Candidates(np.tile(np.eye(k), (len(pairs), 1, 1, 1)), np.full((len(pairs), 1), np.inf))
    for edge, one in zip(doubtful, judged, strict=True):
        more.maps[edge], more.costs[edge] = one.maps, one.costs
    both = joined(alone, more)
    return alone, both, agree(both.maps, both.costs, pairs, len(members)) if again else first


def _finer(members: Sequence[Member], bases: FloatArray, pairs: IntArray, refiner: Multistart, run: _Run) -> FloatArray:
    """Return the bases of consistent maps that are as fine as the eigenfunctions of all shapes allow."""
    most = min(*(n_eigenfunctions(member.mesh) for member in members), refiner.schedule[-1])
    for size in (size for size in SIZES if bases.shape[-1] < size <= most):
        now = composed(bases, pairs)
        tasks = [
            EdgeTask(members[i], members[j], refiner, size, one[None]) for (i, j), one in zip(pairs, now, strict=True)
        ]
        maps = np.stack(run(finer_map, tasks, EdgeTask.label_of, f"refine to {size}", "pair"))
        bases = consistent(maps, pairs, 2 * SCALE, len(members))
    return bases


def _edges(alone: Candidates, agreement: Agreement, pairs: IntArray, names: Sequence[str]) -> tuple[Edge, ...]:
    best = alone.costs.argmin(1)
    each = np.arange(len(pairs))
    away = apart(alone.maps[each, best], composed(agreement.bases, pairs))
    return tuple(
        Edge(names[i], names[j], float(cost), float(distance), bool(distance > MENDED))
        for (i, j), cost, distance in zip(pairs, alone.costs[each, best], away, strict=True)
    )


def medoid(pairs: IntArray, costs: FloatArray, n: int) -> int:
    """Return the shape from which all others are reached along edges at the least sum of costs.

    Examples
    --------
    >>> medoid(np.array([[0, 1], [1, 2]]), np.ones(2), 3)
    1
    """
    lengths = shortest_path(csr_matrix((np.maximum(costs, 1e-9), pairs.T), shape=(n, n)), directed=False)
    return int(lengths.sum(1).argmin())
