"""A matched collection: consistent maps between any two of its shapes, made when they are asked for."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations
from pathlib import Path
from typing import TypeAlias

from csm._counts import counted
from csm._parallel import parallel_map
from csm._places import load
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.matching.both import both_ways_of
from csm.matching.collection.members import EdgeTask, Member, both_maps, finest
from csm.matching.confidence import confidence_of
from csm.matching.functional import FunctionalMap
from csm.matching.maps import VertexMap
from csm.matching.match import match_of
from csm.matching.methods import Method
from csm.matching.nearest import Nearest
from csm.matching.refinement.base import Refined, start_of
from csm.matching.refinement.multistart import Multistart
from csm.matching.refinement.pair import Pair
from csm.matching.result import Match
from csm.matching.signals import Sides
from csm.matching.subjects import Subject, on_given, on_given_vertices
from csm.matching.way import Way
from csm.mesh.shape import Mesh

Which: TypeAlias = int | str
"""A shape of a collection, by its number or its name."""

Both: TypeAlias = tuple[IntArray, IntArray]
"""Maps between two cleaned meshes, there and back."""


@dataclass(frozen=True)
class Edge:
    """One pair of a collection that was matched by itself, and what the others say of it.

    Parameters
    ----------
    source, target
        Names of the shapes.
    cost
        How bad the best map of the pair by itself looks, without the others; less is better.
    apart
        How far that map is from what the collection agrees on: 0 for the same, about 1 for unrelated ones.
    mended
        Whether the collection has another map of this pair: `apart` is large.
    """

    source: str
    target: str
    cost: float
    apart: float
    mended: bool


@dataclass(frozen=True, eq=False)
class Cycles:
    """How well cycles of three shapes close, |C_ij C_jk - C_ik| / sqrt(2 K), shape (T,) each.

    Parameters
    ----------
    alone
        Of the best map of each pair by itself.
    together
        Of the maps that the collection chose; those that it agreed on close exactly.
    """

    alone: FloatArray
    together: FloatArray


@dataclass(frozen=True, eq=False)
class MatchedCollection:
    """Shapes with maps between any two of them that agree around cycles; see `csm.match_collection`.

    Parameters
    ----------
    subjects, members
        The shapes as they were given and as they are computed with.
    bases
        Shape (n, K, K), orthogonal: one matrix Y_i per shape, of which the functional map i -> j is Y_i Y_j^T.
    edges
        The pairs that were matched by themselves.
    cycles
        How well they close cycles.
    method, refiner
        How maps are made.
    reference_index
        Number of the reference shape, the medoid: the one that the others are matched to at the least cost.
    """

    subjects: tuple[Subject, ...]
    members: tuple[Member, ...]
    bases: FloatArray
    edges: tuple[Edge, ...]
    cycles: Cycles
    method: Method
    refiner: Multistart
    reference_index: int
    _kept: dict[tuple[int, int], Both] = field(default_factory=dict, init=False, repr=False)  # those of the reference

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, in order."""
        return tuple(subject.given.name for subject in self.subjects)

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        """The shapes, with the vertices as they were given."""
        return tuple(subject.given for subject in self.subjects)

    @property
    def reference(self) -> str:
        """Name of the reference shape."""
        return self.names[self.reference_index]

    @property
    def mended(self) -> tuple[Edge, ...]:
        """The pairs whose own map was replaced by what the others say."""
        return tuple(edge for edge in self.edges if edge.mended)

    @property
    def text(self) -> str:
        """How it was made, in words."""
        k = self.bases.shape[-1]
        return (
            f"{len(self.names)} shapes, {counted(len(self.edges), 'pair')} of them matched by several starts; "
            f"{len(self.mended)} of these maps did not agree with the others and were replaced; functional maps of {k} "
            f"functions that close every cycle, refined jointly with the descriptor to {self.refiner.schedule[-1]}"
        )

    @cached_property
    def trusted(self) -> dict[str, float]:
        """Name -> share of each shape that has a trustworthy partner on the reference, see `Confidence.trusted`."""
        others = [i for i in range(len(self.names)) if i != self.reference_index]
        return {self.names[i]: self._trusted(i, self.reference_index) for i in others}

    def number(self, which: Which) -> int:
        """Return the number of a shape; ConfigError if there is none of that number or name."""
        if isinstance(which, str) and which in self.names:
            return self.names.index(which)
        if not isinstance(which, str) and -len(self.names) <= which < len(self.names):
            return int(which) % len(self.names)
        few = ", ".join(self.names[:5]) + (", ..." if len(self.names) > 5 else "")
        raise ConfigError(f"collection: there is no shape {which!r} among the {len(self.names)}: {few}")

    def functional_map(self, source: Which, target: Which) -> FunctionalMap:
        """Return the functional map that the collection agreed on, before it becomes finer."""
        i, j = self.number(source), self.number(target)
        return FunctionalMap(self._matrix(i, j), self.names[i], self.names[j])

    def match(self, source: Which, target: Which) -> Match:
        """Return the match of two shapes, with all that `csm.match` returns."""
        i, j = self.number(source), self.number(target)
        if i > j:
            return self.match(j, i).inverse
        described = self.members[i].described(), self.members[j].described()
        found = finest(self._matrix(i, j), Pair.of(*described), self.refiner.climb)
        rule = Refined(Nearest(), self.refiner)
        ways = both_ways_of(replace(found, text=self.text), rule, *described)
        return match_of(ways, (self.subjects[i], self.subjects[j]), described, self.method, rule)

    def vertex_map(self, source: Which, target: Which) -> VertexMap:
        """Return the vertex map of two shapes."""
        return self.vertex_maps([(source, target)], workers=0, progress=False)[0]

    def vertex_maps(
        self, pairs: Sequence[tuple[Which, Which]] | None = None, *, workers: int | None = None, progress: bool = True
    ) -> list[VertexMap]:
        """Return the vertex maps of many pairs.

        Parameters
        ----------
        pairs
            Sources and targets; all ordered pairs by default.
        workers
            Processes of one thread; by default one per core where that pays.
        progress
            Show a bar with the name of the pair.
        """
        asked = permutations(range(len(self.names)), 2) if pairs is None else pairs
        wanted = [(self.number(source), self.number(target)) for source, target in asked]
        both = sorted({(min(pair), max(pair)) for pair in wanted})  # a pair gives the maps of both directions
        found = {pair: self._kept[pair] for pair in both if pair in self._kept}
        missing = [pair for pair in both if pair not in found]
        tasks = [self._task(*pair) for pair in missing]
        n = workers if self.members[0].device == "cpu" else 0
        done = parallel_map(both_maps, tasks, EdgeTask.label_of, n, what="map", unit="pair", progress=progress)
        found |= zip(missing, done, strict=True)
        self._kept.update({pair: maps for pair, maps in found.items() if self.reference_index in pair})
        return [self._given(i, j, found[i, j][0] if i <= j else found[j, i][1]) for i, j in wanted]

    def save(self, folder: str | os.PathLike[str], *, pairs: str = "auto", overwrite: bool = False) -> Path:
        """Write what ``csm match folder=DIR`` writes: maps, coloured meshes, a page to look at and an account.

        Files that are as csm left them are replaced, others only with `overwrite`, and an input never: a DataError.
        """
        saver: Callable[..., Path] = load("csm.viewer.collection_folder:save_collection")
        return saver(self, folder, pairs=pairs, overwrite=overwrite)

    def _matrix(self, i: int, j: int) -> FloatArray:
        matrix: FloatArray = self.bases[i] @ self.bases[j].T
        return matrix

    def _task(self, i: int, j: int) -> EdgeTask:
        maps = self._matrix(i, j)[None]
        return EdgeTask(self.members[i], self.members[j], self.refiner, maps.shape[-1], maps)

    def _trusted(self, i: int, j: int) -> float:
        """Return the share of shape i with a trustworthy partner on shape j, by the maps that are known of both."""
        _ = self.vertex_map(i, j)
        there, back = self._kept[min(i, j), max(i, j)][:: 1 if i < j else -1]
        source, target = self.members[i].described(), self.members[j].described()
        forward, backward = VertexMap(there, target.mesh.n_vertices), VertexMap(back, source.mesh.n_vertices)
        found = confidence_of(Sides(source, target, forward, backward), start_of(Nearest(), source, target))
        given = on_given(Way(forward, confidence=found), self.subjects[i], self.subjects[j])
        return given.confidence.trusted if given.confidence else 0.0

    def _given(self, i: int, j: int, indices: IntArray) -> VertexMap:
        """Return a vertex map of cleaned meshes as one of the given meshes."""
        source, target = self.members[i].mesh, self.members[j].mesh
        found = VertexMap(indices, target.n_vertices, source.name, target.name)
        return on_given_vertices(found, self.subjects[i], self.subjects[j])

    def __repr__(self) -> str:
        return (
            f"MatchedCollection({len(self.names)} shapes by {self.method.name}, reference {self.reference}, "
            f"{len(self.mended)} of {counted(len(self.edges), 'pair')} mended)"
        )
