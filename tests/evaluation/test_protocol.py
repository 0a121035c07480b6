"""The evaluation against a slow one with full distance matrices; pair lists; what is refused."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from csm.data.shapeset import Shape
from csm.errors import ConfigError, DataError
from csm.evaluation import metrics, protocol
from csm.evaluation.protocol import Protocol, evaluate_matches
from csm.evaluation.results import Evaluation
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method, diameter, geodesics
from tests.shapes import blob

N = 162


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


def to_shape(indices: np.ndarray, n: int = N) -> PointMap:
    return PointMap(indices, Direction.TEMPLATE_TO_SHAPE, n)


def noisy(source: Shape, target: Shape) -> np.ndarray:
    """Half right, a third off by a few vertices, the rest anywhere; the same for each pair whenever it is asked."""
    rng = np.random.default_rng([ord(c) for c in source.name + target.name])
    draw, match = rng.random(N), np.arange(N)
    match[draw > 0.5] = (match + rng.integers(1, 4, N))[draw > 0.5] % N
    match[draw > 0.8] = rng.integers(0, N, N)[draw > 0.8]
    assert target.mirror is not None
    return np.where((draw > 0.9) & (target.mirror.indices >= 0), target.mirror.indices, match)


def slowly(items: list[Shape], protocol: Protocol) -> dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]:
    """Errors and flips of each pair, point by point, from full matrices."""
    found = {}
    for target in items:
        rows = geodesics(target.mesh, protocol.distance).rows(np.arange(N))
        length = (
            diameter(target.mesh, protocol.distance) if protocol.normaliser == "diameter" else target.mesh.area**0.5
        )
        for source in items:
            if source is target:
                continue
            match, errors, flips = noisy(source, target), [], []
            for s, t, m in zip(source.truth.indices, target.truth.indices, target.mirror.indices, strict=True):
                if s >= 0 and t >= 0:
                    errors.append(rows[t, match[s]] / length)
                    flips.append(m >= 0 and rows[m, match[s]] / length + metrics.FLIP_MARGIN < errors[-1])
            found[source.name, target.name] = np.array(errors), np.array(flips)
    return found


@pytest.mark.parametrize("distance", ["exact", "heat", "edge"])
@pytest.mark.parametrize("normaliser", ["diameter", "sqrt_area"])
def test_equals_the_slow_evaluation(distance: Method, normaliser: Literal["diameter", "sqrt_area"]) -> None:
    items, protocol = shapes(), Protocol(distance=distance, normaliser=normaliser)
    evaluation, expected = evaluate_matches(items, noisy, protocol, progress=False), slowly(items, protocol)
    assert [(row.source, row.target) for row in evaluation.rows] == protocol.choose(["s0", "s1", "s2"])
    begin = 0
    for row in evaluation.rows:
        errors, flips = expected[row.source, row.target]
        np.testing.assert_allclose(evaluation.errors[begin : begin + row.points], errors, atol=1e-6)
        assert row.age == pytest.approx(errors.mean(), abs=1e-6)
        assert row.p95 == pytest.approx(np.percentile(errors, 95), abs=1e-6)
        assert row.exact == pytest.approx((errors == 0).mean())
        assert row.flip == pytest.approx(flips.mean())
        assert flips.any()
        begin += row.points
    pooled = np.concatenate([expected[row.source, row.target][0] for row in evaluation.rows])
    assert evaluation.summary["age"] == pytest.approx(pooled.mean(), abs=1e-6)
    assert evaluation.summary["points"] == len(pooled) == begin
    np.testing.assert_allclose(
        evaluation.cqc, [(pooled <= t + 1e-12).mean() for t in evaluation.thresholds], atol=0.003
    )


def test_both_normalisers_are_in_every_summary() -> None:
    items = shapes()
    by_diameter = evaluate_matches(items, noisy, Protocol(), progress=False).summary
    by_area = evaluate_matches(items, noisy, Protocol(normaliser="sqrt_area"), progress=False).summary
    assert by_diameter["age"] == pytest.approx(by_diameter["age_diameter"])
    assert by_diameter["age_sqrt_area"] == pytest.approx(by_area["age"])
    assert by_area["age_diameter"] == pytest.approx(by_diameter["age"])


def test_scale_plays_no_part_and_the_truth_has_no_error() -> None:
    items = shapes()
    large = [Shape(Mesh(100 * s.mesh.vertices, s.mesh.faces, s.name), s.truth, s.mirror) for s in items]
    a, b = (evaluate_matches(x, noisy, Protocol(), progress=False) for x in (items, large))
    np.testing.assert_allclose(a.errors, b.errors, atol=1e-9)
    perfect = evaluate_matches(items, lambda s, t: np.arange(N), Protocol(), progress=False).summary
    assert (perfect["age"], perfect["exact"], perfect["auc"], perfect["flip_rate"]) == (0.0, 1.0, 1.0, 0.0)


@pytest.mark.slow
def test_workers_change_nothing() -> None:
    one, two = (evaluate_matches(shapes(), noisy, Protocol(), progress=False, workers=w) for w in (1, 2))
    np.testing.assert_array_equal(one.errors, two.errors)


@pytest.mark.slow
def test_a_worker_has_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.delenv(variable, raising=False)
    with protocol._pool(2) as submit:
        libraries = submit(threadpool_info).result()
    assert libraries
    assert {library["num_threads"] for library in libraries} == {1}


def test_matching_goes_on_while_distances_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """The workers wait here until the last pair is matched; an evaluation that waited for them would not end well."""
    asked, all_matched, pairs = [], threading.Event(), 6

    @contextmanager
    def patient(workers: int) -> Iterator[Callable[..., Future[object]]]:
        def wait_and_run(function: Callable[..., object], *args: object) -> object:
            assert all_matched.wait(timeout=20)
            return function(*args)

        with ThreadPoolExecutor(workers) as pool:
            yield lambda *job: pool.submit(wait_and_run, *job)

    def match(source: Shape, target: Shape) -> np.ndarray:
        asked.append((source.name, target.name))
        if len(asked) == pairs:
            all_matched.set()
        return noisy(source, target)

    monkeypatch.setattr(protocol, "_pool", patient)
    assert len(evaluate_matches(shapes(), match, Protocol(), progress=False, workers=2).rows) == pairs


def test_a_match_on_another_component_counts_as_a_diameter() -> None:
    mesh = blob(1)
    n = mesh.n_vertices
    both = Mesh(np.concatenate([mesh.vertices, mesh.vertices + 9]), np.concatenate([mesh.faces, mesh.faces + n]), "a")
    items = [Shape(Mesh(both.vertices, both.faces, name), to_shape(np.arange(n), 2 * n)) for name in "ab"]

    def astray(source: Shape, target: Shape) -> np.ndarray:
        match = np.arange(2 * n)
        match[:3] += n
        return match

    row = evaluate_matches(items, astray, Protocol(), progress=False).rows[0]
    assert row.unreachable == 3
    assert row.age == pytest.approx(3 / n)
    assert row.flip is None


def test_pairs_are_all_or_listed_or_drawn() -> None:
    names = ["a", "b", "c", "d"]
    everything = Protocol().choose(names)
    assert len(everything) == 12
    assert all(s != t for s, t in everything)
    assert Protocol(pairs=[("a", "b"), ("a", "a")]).choose(names) == [("a", "b"), ("a", "a")]
    drawn = Protocol(sample=5, seed=3).choose(names)
    assert drawn == Protocol(sample=5, seed=3).choose(names)
    assert len(set(drawn)) == 5
    assert set(drawn) <= set(everything)
    assert any(Protocol(sample=5, seed=seed).choose(names) != drawn for seed in range(4))
    assert Protocol(sample=50).choose(names) == everything


@pytest.mark.parametrize(
    ("protocol", "said"),
    [
        (Protocol(), ["all ordered pairs without self-pairs", "exact geodesic", "geodesic diameter"]),
        (Protocol(pairs=[("a", "b")], distance="edge", normaliser="sqrt_area"), ["given list", "edges", "square root"]),
        (Protocol(sample=7, seed=4, distance="heat"), ["7 pairs", "seed 4", "heat"]),
    ],
)
def test_describe_says_every_fact(protocol: Protocol, said: list[str]) -> None:
    assert all(words in protocol.describe() for words in [*said, "pooled", "known on both"])


@pytest.mark.parametrize("bad", [{"distance": "far"}, {"normaliser": "volume"}, {"pairs": "some"}, {"sample": 0}])
def test_protocols_that_cannot_work(bad: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(bad))):
        Protocol(**bad)  # type: ignore[arg-type]


def test_what_cannot_be_evaluated() -> None:
    items = shapes(2)

    def run(match: Callable[[Shape, Shape], np.ndarray], protocol: Protocol = Protocol()) -> Evaluation:  # noqa: B008
        return evaluate_matches(items, match, protocol, progress=False)

    with pytest.raises(DataError, match=r"s1 -> s0.*wanted 162"):
        run(lambda s, t: np.arange(5), Protocol(pairs=[("s1", "s0")]))
    with pytest.raises(DataError, match=r"0\.\.161"):
        run(lambda s, t: np.full(N, N))
    with pytest.raises(DataError, match="'zz'"):
        run(noisy, Protocol(pairs=[("s0", "zz")]))
    with pytest.raises(DataError, match="different names"):
        evaluate_matches([items[0], items[0]], noisy, Protocol())
    with pytest.raises(DataError, match="no pair"):
        evaluate_matches(items[:1], noisy, Protocol())


@pytest.mark.data
def test_near_misses_on_bodies_take_seconds(data_set: Callable[[str], Path]) -> None:
    folder = data_set("FAUST_6890") / "shapes"
    items = [Shape(read_mesh(folder / f"tr_reg_{i:03d}.mat"), PointMap.identity(6890)) for i in (80, 81)]
    first = items[0].mesh.faces[np.unique(items[0].mesh.faces[:, 0], return_index=True)[1]]
    neighbour = np.arange(6890)
    neighbour[first[:, 0]] = first[:, 1]
    evaluation = evaluate_matches(items, lambda s, t: neighbour, Protocol(), progress=False)
    for row, mesh in zip(evaluation.rows, (items[1].mesh, items[0].mesh), strict=True):
        edges = np.linalg.norm(mesh.vertices[neighbour] - mesh.vertices, axis=1)
        assert row.age * row.diameter <= edges.mean() + 1e-12
        assert row.age * row.diameter >= 0.98 * edges.mean()
        assert 1.4 < row.diameter / row.sqrt_area < 1.7


def test_some_points_of_all_pairs_give_the_errors_of_exactly_these_points():
    mesh = blob(2)
    shapes = [Shape(Mesh(mesh.vertices, mesh.faces, name), PointMap.identity(162)) for name in "ab"]
    indices = np.roll(np.arange(162), 1)
    full = evaluate_matches(shapes, lambda s, t: indices, Protocol(), progress=False)
    some = evaluate_matches(shapes, lambda s, t: indices, Protocol(points=40, seed=3), progress=False)
    chosen = np.sort(np.random.default_rng(3).permutation(162)[:40])
    np.testing.assert_allclose(some.errors, np.concatenate([full.errors[chosen], full.errors[162 + chosen]]))
    assert "those of 40 (drawn with seed 3) template points" in some.describe()
    with pytest.raises(ConfigError, match="points=0"):
        Protocol(points=0)
