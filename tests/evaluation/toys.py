"""Shapes, matchers and a slow evaluation for the tests of the engine."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from scipy.spatial.distance import cdist

from csm.data.shapes import InMemory, Shape
from csm.data.store import Store
from csm.descriptors.base import Descriptor
from csm.errors import DataError, MeshError
from csm.evaluation import metrics
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.evaluation.results import Evaluation
from csm.matching.base import Described, Matcher
from csm.matching.maps import VertexMap
from csm.matching.methods import Method, PrecomputedMethod
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.perturb import Damaged, without_part
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method as Distance
from csm.operators.geodesic import geodesics
from tests.shapes import blob

N = 162
Match = Callable[[Shape, Damaged], np.ndarray]
"""Source and changed target -> for every vertex of the source a vertex of the changed target."""


def to_shape(indices: np.ndarray, n: int = N) -> PointMap:
    return PointMap(indices, Direction.TEMPLATE_TO_SHAPE, n)


def shapes(n: int = 3) -> list[Shape]:
    """Bumpy spheres of one connectivity; some template points are unknown, and x -> -x is the mirror."""
    found = []
    for seed in range(n):
        mesh = blob(2, seed)
        truth = np.arange(N)
        truth[seed : 40 * seed] = -1
        sphere = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
        mirror = ((sphere[:, None] * [-1, 1, 1] - sphere[None]) ** 2).sum(-1).argmin(1)
        mirror[100:110] = -1
        found.append(Shape(Mesh(mesh.vertices, mesh.faces, f"s{seed}"), to_shape(truth), to_shape(mirror)))
    return found


def noisy(source: str, target: str) -> np.ndarray:
    """Half right, a third off by a few vertices, the rest anywhere; the same for each pair whenever it is asked."""
    rng = np.random.default_rng([ord(c) for c in source + target])
    draw, match = rng.random(N), np.arange(N)
    match[draw > 0.5] = (match + rng.integers(1, 4, N))[draw > 0.5] % N
    match[draw > 0.8] = rng.integers(0, N, N)[draw > 0.8]
    mirror = {shape.name: shape.mirror for shape in shapes()}[target].indices
    return np.where((draw > 0.9) & (mirror >= 0), mirror, match)


@dataclass(frozen=True)
class Noisy(Matcher):
    """The matches of `noisy` on whole targets."""

    name: ClassVar[str] = "noisy"

    def __call__(self, source: Described, target: Described, at: np.ndarray | None = None) -> VertexMap:
        return VertexMap(noisy(source.mesh.name, target.mesh.name), N)


@dataclass(frozen=True)
class Fixed(Matcher):
    """The same indices for every pair, as long as they are to be."""

    indices: tuple[int, ...]
    n_target: int = N
    name: ClassVar[str] = "fixed"

    def __call__(self, source: Described, target: Described, at: np.ndarray | None = None) -> VertexMap:
        return VertexMap(np.array(self.indices, dtype=np.int64), self.n_target)


class Positions(Method):
    """A method that knows where vertices are, so that it matches copies of a shape, also cut ones, without error."""

    name = "positions"

    @property
    def key(self) -> Mapping[str, str]:
        return {"name": self.name}

    @property
    def recipe(self) -> None:
        return

    def describe(self, mesh: Mesh, store: Store, device: str = "cpu") -> Described:
        return Described(mesh, torch.from_numpy(mesh.vertices.copy()).to(device))


class OnlyWhole(Positions):
    """The same, but it cannot describe a part of a shape."""

    name = "only whole"

    def describe(self, mesh: Mesh, store: Store, device: str = "cpu") -> Described:
        if mesh.n_vertices < N:
            raise MeshError(f"{mesh.name}: it has a boundary")
        return super().describe(mesh, store, device)


class WithABadOne(InMemory):
    """Shapes of which one cannot be read."""

    def load(self, name: str) -> Shape:
        if name == "s1":
            raise DataError("s1.off: cut off")
        return super().load(name)


def nothing(items: Sequence[Shape]) -> PrecomputedMethod:
    """A method without features, for matchers that need none."""
    return PrecomputedMethod({s.name: torch.zeros(s.mesh.n_vertices, 1) for s in items}, "nothing")


def measure(items: Sequence[Shape], matcher: Matcher, protocol: EvaluationProtocol | None = None) -> Evaluation:
    """Evaluate one matcher in this process."""
    (found,) = evaluate(nothing(items), items, protocol, matching=matcher, workers=0, progress=False)
    return found


def cut(mesh: Mesh) -> Damaged:
    """Cut a fifth of the area away."""
    return without_part(mesh, 7, 0.2)


def cannot(mesh: Mesh) -> Damaged:
    """A change that cannot be made of the second shape."""
    if mesh.name == "s1":
        raise MeshError(f"{mesh.name}: it is too thin")
    return cut(mesh)


def by_features(descriptor: Descriptor) -> Match:
    """Brute force in double precision."""

    def match(source: Shape, target: Damaged) -> np.ndarray:
        here, there = (descriptor(mesh).values.astype(np.float32).astype(float) for mesh in (source.mesh, target.mesh))
        return cdist(here, there).argmin(1)

    return match


def slowly(
    items: Sequence[Shape],
    protocol: EvaluationProtocol,
    match: Match,
    change: Callable[[Mesh], Damaged] | None = None,
) -> Mapping[Pair, tuple[np.ndarray, np.ndarray]]:
    """Errors and flips of each pair, point by point, from full matrices of distances."""
    found, by_name = {}, {shape.name: shape for shape in items}
    for pair in protocol.choose(list(by_name)):
        source, target = (by_name[name] for name in pair)
        rows, diameter = all_distances(target.name, protocol.distance)
        length = diameter if protocol.normaliser == "diameter" else target.mesh.area**0.5
        changed = Damaged(target.mesh, np.arange(N)) if change is None else change(target.mesh)
        matched, errors, flips = changed.kept[match(source, changed)], [], []
        for point in drawn_points(source, target, changed, protocol):
            s, t, m = (int(x.indices[point]) for x in (source.truth, target.truth, target.mirror))
            errors.append(rows[t, matched[s]] / length)
            flips.append(m >= 0 and rows[m, matched[s]] / length + metrics.FLIP_MARGIN < errors[-1])
        found[pair] = np.array(errors), np.array(flips)
    return found


@functools.cache
def all_distances(name: str, distance: Distance) -> tuple[np.ndarray, float]:
    surface = geodesics({shape.name: shape.mesh for shape in shapes()}[name], distance)
    return surface.rows(np.arange(N)), surface.diameter()


def drawn_points(source: Shape, target: Shape, changed: Damaged, protocol: EvaluationProtocol) -> list[int]:
    s, t = source.truth.indices, target.truth.indices
    common = [p for p in range(N) if s[p] >= 0 and t[p] >= 0 and t[p] in set(changed.kept.tolist())]
    if protocol.points is None:
        return common
    draw = np.random.default_rng(protocol.seed)
    if protocol.drawn == "pair":
        return sorted(np.array(common)[draw.permutation(len(common))[: protocol.points]].tolist())
    of_template = set(draw.permutation(N)[: protocol.points].tolist())
    return [p for p in common if p in of_template]


def assert_equals(evaluation: Evaluation, expected: Mapping[Pair, tuple[np.ndarray, np.ndarray]]) -> None:
    """Compare an evaluation, point by point and row by row, with what `slowly` gave."""
    assert [(row.source, row.target) for row in evaluation.rows] == list(expected)
    begin = 0
    for row in evaluation.rows:
        errors, flips = expected[row.source, row.target]
        np.testing.assert_allclose(evaluation.errors[begin : begin + row.points], errors, atol=1e-6)
        assert row.points == len(errors) > 0
        assert abs(row.age - errors.mean()) < 1e-6
        assert abs(row.p95 - np.percentile(errors, 95)) < 1e-6
        assert abs(row.exact - (errors == 0).mean()) < 1e-9
        assert row.flip is None or abs(row.flip - flips.mean()) < 1e-9
        begin += row.points
    assert evaluation.summary["points"] == len(evaluation.errors) == begin
