"""The engine against a slow evaluation with full distance matrices; what it takes, gives and refuses."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch

from csm.data.shapes import InMemory, Shape
from csm.data.store import Store
from csm.descriptors import HKS, Coordinates
from csm.errors import ConfigError, DataError
from csm.evaluation import engine, evaluate
from csm.evaluation.protocol import EvaluationProtocol
from csm.matching.methods import DescriptorMethod, PrecomputedMethod
from csm.matching.nearest import Nearest
from csm.mesh.correspondence import PointMap
from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method
from tests.conftest import ROOT
from tests.evaluation.toys import (
    Fixed,
    N,
    Noisy,
    Positions,
    assert_equals,
    by_features,
    cut,
    measure,
    noisy,
    nothing,
    shapes,
    slowly,
    to_shape,
)
from tests.shapes import blob

CHEAP, PLACES = HKS(k=10, n_times=6), Coordinates()


def here(*arguments: object, **options: object):
    """Evaluate in this process and without bars."""
    return evaluate(*arguments, **({"workers": 0, "progress": False} | options))  # type: ignore[arg-type]


def given_matches(source, target):
    return noisy(source.name, target.mesh.name)


@pytest.mark.parametrize("distance", ["exact", "heat", "edge"])
@pytest.mark.parametrize("normaliser", ["diameter", "sqrt_area"])
def test_equals_the_slow_evaluation(distance: Method, normaliser: Literal["diameter", "sqrt_area"]) -> None:
    items, protocol = shapes(), EvaluationProtocol(distance=distance, normaliser=normaliser)
    evaluation, expected = measure(items, Noisy(), protocol), slowly(items, protocol, given_matches)
    assert list(expected) == protocol.choose(["s0", "s1", "s2"])
    assert_equals(evaluation, expected)
    assert all(flips.any() for _, flips in expected.values())
    pooled = np.concatenate([errors for errors, _ in expected.values()])
    assert evaluation.summary["age"] == pytest.approx(pooled.mean(), abs=1e-6)
    np.testing.assert_allclose(
        evaluation.cqc, [(pooled <= t + 1e-12).mean() for t in evaluation.thresholds], atol=0.003
    )


@pytest.mark.parametrize(
    "protocol",
    [
        EvaluationProtocol(),
        EvaluationProtocol(points=40, seed=3, distance="edge"),
        EvaluationProtocol(points=40, seed=3, drawn="pair", normaliser="sqrt_area", distance="heat"),
        EvaluationProtocol(pairs=[("s2", "s0"), ("s0", "s1"), ("s0", "s0")], distance="edge"),
    ],
    ids=lambda p: f"{p.distance}-{p.drawn}-{p.points}",
)
@pytest.mark.parametrize("change", [None, cut])
def test_many_methods_and_matchers_at_once_equal_each_alone(tmp_path, protocol, change) -> None:
    items = shapes()
    found = here(
        [DescriptorMethod(CHEAP, "one"), PLACES],
        items,
        protocol,
        matching=["nearest"] if change else [Noisy(), "nearest"],
        perturbations={"whole or cut": change},
        store=Store(tmp_path),
    )
    kinds = ["nearest"] if change else ["noisy", "nearest"]
    assert [(e.method, e.matcher) for e in found] == [(m, k) for m in ("one", "xyz") for k in kinds]
    for e in found:
        match = given_matches if e.matcher == "noisy" else by_features(CHEAP if e.method == "one" else PLACES)
        assert_equals(e, slowly(items, protocol, match, change))
        assert e.perturbation == "whole or cut"
        assert all((row.left < 0.95) == (change is cut) for row in e.rows)


def test_a_perfect_method_has_no_error_whatever_is_cut_away(tmp_path) -> None:
    """Errors are measured on the whole target, so the numbers of what is left have to be translated."""
    items = [Shape(blob(2, 0), to_shape(np.arange(N)))]
    items.append(Shape(Mesh(items[0].mesh.vertices, items[0].mesh.faces, "copy"), items[0].truth))
    changes = {"none": None, "cut": cut}
    (whole, left) = here(Positions(), items, store=Store(tmp_path), perturbations=changes, keep_pairs=True)
    assert (whole.summary["exact"], left.summary["exact"]) == (1.0, 1.0)
    assert (whole.rows[0].left, whole.rows[0].points) == (1.0, N)
    assert (left.rows[0].points, left.rows[0].left) == (len(cut(items[0].mesh).kept), left.rows[0].points / N)
    assert set(left.pairs[0].points.matched) == set(cut(items[0].mesh).kept)


def test_both_normalisers_are_in_every_summary() -> None:
    by_diameter = measure(shapes(), Noisy()).summary
    by_area = measure(shapes(), Noisy(), EvaluationProtocol(normaliser="sqrt_area")).summary
    assert by_diameter["age"] == pytest.approx(by_diameter["age_diameter"])
    assert by_diameter["age_sqrt_area"] == pytest.approx(by_area["age"])
    assert by_area["age_diameter"] == pytest.approx(by_diameter["age"])


def test_scale_plays_no_part_and_the_truth_has_no_error() -> None:
    items = shapes()
    large = [Shape(Mesh(100 * s.mesh.vertices, s.mesh.faces, s.name), s.truth, s.mirror) for s in items]
    a, b = (measure(x, Noisy()) for x in (items, large))
    np.testing.assert_allclose(a.errors, b.errors, atol=1e-9)
    perfect = measure(items, Fixed(tuple(range(N)))).summary
    assert (perfect["age"], perfect["exact"], perfect["auc"], perfect["flip_rate"]) == (0.0, 1.0, 1.0, 0.0)


def test_a_match_on_another_component_counts_as_a_diameter() -> None:
    mesh = blob(1)
    n = mesh.n_vertices
    both = Mesh(np.concatenate([mesh.vertices, mesh.vertices + 9]), np.concatenate([mesh.faces, mesh.faces + n]), "a")
    items = [Shape(Mesh(both.vertices, both.faces, name), to_shape(np.arange(n), 2 * n)) for name in "ab"]
    astray = np.arange(2 * n)
    astray[:3] += n
    row = measure(items, Fixed(tuple(astray.tolist()), 2 * n)).rows[0]
    assert row.unreachable == 3
    assert row.age == pytest.approx(3 / n)
    assert row.flip is None


def test_some_points_of_all_pairs_give_the_errors_of_exactly_these_points() -> None:
    mesh = blob(2)
    items = [Shape(Mesh(mesh.vertices, mesh.faces, name), PointMap.identity(N)) for name in "ab"]
    rolled = Fixed(tuple(np.roll(np.arange(N), 1).tolist()))
    full, some = measure(items, rolled), measure(items, rolled, EvaluationProtocol(points=40, seed=3))
    chosen = np.sort(np.random.default_rng(3).permutation(N)[:40])
    np.testing.assert_allclose(some.errors, np.concatenate([full.errors[chosen], full.errors[N + chosen]]))


def test_scaled_edge_paths_are_near_the_exact_errors_and_say_how_near() -> None:
    full = measure(shapes(), Noisy())
    some = measure(shapes(), Noisy(), EvaluationProtocol(exact_points=60))
    assert (full.uncertainty, some.rows[0].points) == (0.0, full.rows[0].points)
    assert 0 < some.uncertainty < 0.01
    assert abs(some.summary["age"] - full.summary["age"]) < 5 * some.uncertainty
    assert some.summary["exact"] == full.summary["exact"]


@pytest.mark.parametrize(
    "given", ["xyz", PLACES, DescriptorMethod(PLACES), ["xyz"], [PLACES], (DescriptorMethod(PLACES),)]
)
def test_a_preset_a_descriptor_a_method_and_lists_of_them(tmp_path, given) -> None:
    protocol = EvaluationProtocol(sample=1, points=5, distance="edge")
    (found,) = here(given, InMemory(shapes(), "set"), protocol, matching=Nearest(), store=Store(tmp_path))
    assert (found.method, found.matcher, len(found.rows)) == ("xyz", "nearest", 1)
    assert "Evaluation(xyz, nearest: " in repr(found)


@pytest.mark.parametrize(
    ("method", "matching", "said"),
    [
        ("nope", "nearest", "nope"),
        (CHEAP, "nope", "nearest or argmax"),
        ([CHEAP, HKS(k=8)], "nearest", r"2 methods have the names hks, hks; wanted .* different names"),
        ([CHEAP], ["nearest", Nearest()], "2 matchers have the names nearest, nearest"),
        ([], "nearest", "of none"),
        (CHEAP, [], "wanted one or more of nearest, argmax"),
        (3, "nearest", "got a int"),
        (CHEAP, "argmax", "matching=argmax needs a trained network with its classifier"),
    ],
)
def test_what_is_no_method_or_matcher_is_an_error_of_the_user(tmp_path, method, matching, said) -> None:
    with pytest.raises(ConfigError, match=said):
        here(method, shapes(), EvaluationProtocol(pairs=[("s1", "s0")]), matching=matching, store=Store(tmp_path))


def test_what_cannot_be_evaluated() -> None:
    items = shapes(2)
    with pytest.raises(DataError, match=r"s1 -> s0: fixed gave 5 numbers in 0\.\.4; wanted 162, .* in 0\.\.161"):
        measure(items, Fixed((0, 1, 2, 3, 4)), EvaluationProtocol(pairs=[("s1", "s0")]))
    with pytest.raises(DataError, match=r"s0 -> s1: fixed gave 162 numbers in 162\.\.162; wanted 162"):
        measure(items, Fixed((N,) * N, N + 1))
    with pytest.raises(DataError, match=r"s0 -> s1: fixed gave 162 numbers in -1\.\.-1"):
        measure(items, Fixed((-1,) * N))
    with pytest.raises(DataError, match=r"in 0\.\.161, or -1"):
        measure(items, Fixed((N,) * N))
    with pytest.raises(DataError, match="'zz'"):
        measure(items, Noisy(), EvaluationProtocol(pairs=[("s0", "zz")]))
    with pytest.raises(DataError, match="different names"):
        measure([items[0], items[0]], Noisy())
    with pytest.raises(DataError, match="no pair"):
        measure(items[:1], Noisy())


def test_shapes_that_do_not_correspond_are_named() -> None:
    first, second = shapes(2)
    known = np.arange(N)
    odd, even = (
        replace(first, truth=replace(to_shape(np.where(known % 2 == k, known, -1)), name=f"m{k}")) for k in (0, 1)
    )
    even = Shape(Mesh(even.mesh.vertices, even.mesh.faces, "e"), even.truth)
    with pytest.raises(DataError, match="m0 and m1 have no template point in common"):
        measure([odd, even], Fixed(tuple(range(N))))
    short = Shape(second.mesh, to_shape(np.arange(100)))
    with pytest.raises(DataError, match="templates with 162 and 100 points"):
        measure([first, short], Fixed(tuple(range(N))))
    alone = replace(second, truth=to_shape(np.where(known == 5, 5, -1)))
    with pytest.raises(DataError, match="none of the points that are measured is left on the target"):
        measure([first, alone], Fixed(tuple(range(N))), EvaluationProtocol(points=1, seed=0))


@pytest.mark.slow
def test_workers_change_nothing(tmp_path) -> None:
    items, features = shapes(), {s.name: torch.from_numpy(CHEAP(s.mesh).values) for s in shapes()}
    for method in (CHEAP, PrecomputedMethod(features)):
        found = []
        for workers in (1, 2):
            options = {"workers": workers, "store": Store(tmp_path / str(workers)), "perturbations": {"": None}}
            if method is CHEAP:
                options["perturbations"] = {"": None, "cut": cut}
            found.append(here(method, items, matching=["nearest", Noisy()][: 1 + (method is not CHEAP)], **options))
        assert len(found[0]) == len(found[1]) == 2
        for one, two in zip(*found, strict=True):
            np.testing.assert_array_equal(one.errors, two.errors)
            assert one.rows == two.rows


def test_features_end_up_on_the_device_that_is_asked_for(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(engine, "require_device", str)  # it refuses "meta", which is the second device of every machine
    seen = []

    class Watching(Fixed):
        def __call__(self, source, target, at=None):
            seen.extend([source.features.device.type, target.features.device.type])
            return super().__call__(source, target, at)

    method = PrecomputedMethod({s.name: torch.zeros(N, 1) for s in shapes()})
    for given in (method, CHEAP):
        rule = Watching(tuple(range(N)))
        here(given, shapes(), EvaluationProtocol(sample=2), matching=rule, device="meta", store=Store(tmp_path))
    assert seen == ["meta"] * 8


@pytest.mark.gpu
def test_a_gpu_gives_the_same_maps(tmp_path) -> None:
    if not torch.cuda.is_available():
        pytest.skip("needs CUDA")
    one, other = (here(CHEAP, shapes(), device=device, store=Store(tmp_path)) for device in ("cpu", "cuda"))
    np.testing.assert_allclose(one[0].errors, other[0].errors, atol=1e-9)


def test_neither_matching_nor_evaluation_imports_lightning() -> None:
    code = "import csm.matching, csm.evaluation, sys; print(sorted({'lightning', 'hydra'} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


@pytest.mark.data
def test_near_misses_on_bodies_take_seconds(data_set: Callable[[str], Path]) -> None:
    folder = data_set("FAUST_6890") / "shapes"
    items = [Shape(read_mesh(folder / f"tr_reg_{i:03d}.mat"), PointMap.identity(6890)) for i in (80, 81)]
    first = items[0].mesh.faces[np.unique(items[0].mesh.faces[:, 0], return_index=True)[1]]
    neighbour = np.arange(6890)
    neighbour[first[:, 0]] = first[:, 1]
    (evaluation,) = here(nothing(items), items, matching=Fixed(tuple(neighbour.tolist()), 6890))
    for row, mesh in zip(evaluation.rows, (items[1].mesh, items[0].mesh), strict=True):
        edges = np.linalg.norm(mesh.vertices[neighbour] - mesh.vertices, axis=1)
        assert row.age * row.diameter <= edges.mean() + 1e-12
        assert row.age * row.diameter >= 0.98 * edges.mean()
        assert 1.4 < row.diameter / row.sqrt_area < 1.7


def test_a_pair_that_cannot_be_used_leaves_the_others_alone() -> None:
    items = shapes()
    features = PrecomputedMethod({s.name: torch.from_numpy(s.mesh.vertices.copy()) for s in items[:2]})
    (found,) = here(features, items, EvaluationProtocol(distance="edge"), skip_failures=True)
    assert [(row.source, row.target) for row in found.rows] == [("s0", "s1"), ("s1", "s0")]
    assert sorted(found.failures) == ["s2", "s2 -> s0", "s2 -> s1"]


def test_pairs_of_a_set_are_those_within_its_templates() -> None:
    class Classes(InMemory):
        templates = {"s0": "cat", "s1": "cat", "s2": "dog"}  # noqa: RUF012

    (found,) = here(PLACES, Classes(shapes(4)), EvaluationProtocol(distance="edge"))
    assert [(row.source, row.target) for row in found.rows] == [("s0", "s1"), ("s1", "s0")]
