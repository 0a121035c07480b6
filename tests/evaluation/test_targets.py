"""One target at a time: what is kept is not measured again, and what cannot be measured is named."""

from __future__ import annotations

import logging
import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from csm.data.shapes import InMemory, Shape
from csm.data.store import Store
from csm.descriptors import HKS, Coordinates
from csm.errors import ConfigError, DataError, MeshError
from csm.evaluation import EvaluationProtocol, evaluate, targets
from csm.evaluation.results import Cell
from csm.evaluation.targets import Plan, TargetTask, match_target, matched_tasks, measure_target
from csm.matching.methods import DescriptorMethod, PrecomputedMethod
from csm.matching.nearest import Nearest
from csm.mesh.perturb import with_noise
from csm.mesh.shape import Mesh
from tests.evaluation.toys import (
    Fixed,
    N,
    Noisy,
    OnlyWhole,
    Positions,
    WithABadOne,
    cannot,
    cut,
    nothing,
    shapes,
    to_shape,
)

PROTOCOL = EvaluationProtocol(points=30, distance="edge")
EXACTLY = EvaluationProtocol(points=30, exact_points=10)


class Run:
    """Evaluations that keep their results, and note which cells are measured of which target."""

    def __init__(self, folder, monkeypatch) -> None:
        self.folder, self.measured = folder, []
        honest = targets.target_errors

        def watched(mesh, matches, *rest):
            self.measured.append((mesh.name, {m.group.method for m in matches}))
            return honest(mesh, matches, *rest)

        monkeypatch.setattr(targets, "target_errors", watched)

    def __call__(self, methods, items=None, protocol=PROTOCOL, **options):
        settings = {"store": Store(self.folder / "store"), "results": Store(self.folder / "results"), "workers": 0}
        self.measured.clear()
        return evaluate(methods, items or shapes(), protocol, **(settings | {"progress": False} | options))


@pytest.fixture
def run(tmp_path, monkeypatch) -> Run:
    return Run(tmp_path, monkeypatch)


def a_plan(tmp_path, **changes) -> Plan:
    plan = Plan(
        InMemory(shapes()),
        PROTOCOL,
        {"xyz": DescriptorMethod(Coordinates())},
        {"nearest": Nearest()},
        {"": None},
        Store(tmp_path / "store"),
        Store(tmp_path / "results"),
        "cpu",
        False,
    )
    return replace(plan, **changes)


@pytest.mark.parametrize("protocol", [PROTOCOL, EXACTLY], ids=["edge", "some exactly"])
def test_what_is_finished_is_not_measured_again_and_has_the_same_numbers(run, protocol):
    first = run("xyz", protocol=protocol, keep_pairs=True)
    assert len(run.measured) == 3
    (again,) = run("xyz", protocol=protocol, keep_pairs=True)
    assert run.measured == []
    assert again.rows == first[0].rows
    assert again.summary == first[0].summary
    assert again.uncertainty == first[0].uncertainty
    np.testing.assert_array_equal(again.errors, first[0].errors)
    for one, other in zip(first[0].pairs, again.pairs, strict=True):
        np.testing.assert_array_equal(one.points.matched, other.points.matched)
        np.testing.assert_array_equal(one.errors.flip, other.errors.flip)
    (plain,) = run("xyz", protocol=protocol, results=None)
    np.testing.assert_allclose(plain.errors, again.errors, rtol=1e-6)


def test_a_further_method_or_matcher_measures_only_itself(run):
    run(["xyz"])
    both = run(["xyz", HKS(k=8)])
    assert [methods for _, methods in run.measured] == [{"hks"}] * 3
    assert [e.method for e in both] == ["xyz", "hks"]
    run(DescriptorMethod(HKS(k=8), "another name"))
    assert run.measured == []
    run(["xyz"], matching=["nearest", Noisy()])
    assert len(run.measured) == 3
    run(["xyz"], matching=["nearest", Noisy()], perturbations={"none": None, "cut": cut})
    assert len(run.measured) == 3, "of what is cut"


@pytest.mark.parametrize(
    "change",
    [
        {"protocol": replace(PROTOCOL, points=31)},
        {"protocol": replace(PROTOCOL, seed=1)},
        {"protocol": replace(PROTOCOL, drawn="pair")},
        {"protocol": replace(PROTOCOL, normaliser="sqrt_area")},
        {"protocol": EXACTLY},
        {"methods": Coordinates(), "matching": Noisy()},
        {"methods": HKS(k=9)},
        {"perturbations": {"": partial(with_noise, strength=0.1)}},
    ],
    ids=lambda change: next(iter(change)),
)
def test_another_question_is_measured_again(run, change):
    run("xyz")
    run(**({"methods": "xyz"} | change))
    assert len(run.measured) == 3


def test_another_truth_or_mesh_is_measured_again(run):
    items = shapes()
    run("xyz", items)
    moved = replace(items[0], truth=to_shape(np.roll(items[0].truth.indices, 1)))
    run("xyz", [moved, *items[1:]])
    assert len(run.measured) == 3
    bent = Mesh(1.1 * items[2].mesh.vertices, items[2].mesh.faces, "s2")
    run("xyz", [*items[:2], Shape(bent, items[2].truth, items[2].mirror)])
    assert len(run.measured) == 3
    run("xyz", [*items[:2], replace(items[2], mirror=None)])
    assert {name for name, _ in run.measured} == {"s0", "s1", "s2"}


def test_a_changed_perturbation_of_the_same_title_is_measured_again(run):
    for strength, expected in ((0.1, 3), (0.1, 0), (0.2, 3)):
        run(Coordinates(), perturbations={"noise": partial(with_noise, strength=strength)})
        assert len(run.measured) == expected


def test_other_features_of_the_same_name_are_measured_again(run):
    for factor, expected in ((1.0, 3), (1.0, 0), (-1.0, 3)):
        features = {s.name: torch.from_numpy(factor * np.cos(9 * s.mesh.vertices)) for s in shapes()}
        run(PrecomputedMethod(features))
        assert len(run.measured) == expected


def test_an_evaluation_that_was_ended_goes_on_with_the_next_target(run, monkeypatch):
    honest = targets.target_errors

    def ended(mesh, *rest):
        if mesh.name == "s0":  # the last
            raise KeyboardInterrupt
        return honest(mesh, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(targets, "target_errors", ended)
        with pytest.raises(KeyboardInterrupt):
            run("xyz")
    (found,) = run("xyz")
    assert [name for name, _ in run.measured] == ["s0"]
    np.testing.assert_allclose(found.errors, run("xyz", results=None)[0].errors, rtol=1e-6)


@pytest.mark.parametrize("method", [HKS(k=8), Positions()], ids=["prepared", "not prepared"])
def test_a_shape_that_cannot_be_read_is_left_out_with_its_reason(run, method, caplog):
    found = run(method, WithABadOne(shapes()), skip_failures=True)
    assert [(row.source, row.target) for row in found[0].rows] == [("s0", "s2"), ("s2", "s0")]
    assert found[0].failures == {"s1": "s1.off: cut off"}
    assert "s1 is left out: s1.off: cut off" in caplog.text
    with pytest.raises(DataError, match=r"s1\.off: cut off"):
        run(method, WithABadOne(shapes()))
    with pytest.raises(DataError, match=r"none of the 2 pairs could be measured:\ns1: s1\.off"):
        run(method, WithABadOne(shapes()[:2]), skip_failures=True)


def test_a_target_that_cannot_be_measured_is_left_out_with_its_reason(run):
    items = shapes()
    fin = [*items[1].mesh.faces[0, :2], items[1].mesh.faces[100, 0]]
    items[1] = replace(items[1], mesh=replace(items[1].mesh, faces=np.vstack([items[1].mesh.faces, [fin]])))
    protocol = EvaluationProtocol(points=20)
    (found,) = run(Positions(), items, protocol, skip_failures=True)
    assert {row.target for row in found.rows} == {"s0", "s2"}
    assert ("s1", "s0") in {(row.source, row.target) for row in found.rows}, "as a source it is well"
    assert list(found.failures) == ["s1"]
    assert "manifold" in found.failures["s1"]
    with pytest.raises(MeshError, match="manifold"):
        run(Positions(), items, protocol)


def test_a_method_that_fails_on_changed_targets_has_reasons_in_its_own_cells_only(run):
    changes = {"none": None, "cut": cut, "thin": cannot}
    found = {(e.perturbation, e.method): e for e in run([Positions(), OnlyWhole()], perturbations=changes)}
    assert list(found) == [(c, m) for c in changes for m in ("positions", "only whole")]
    boundary = {name: f"{name}: it has a boundary" for name in ("s0", "s1", "s2")}
    thin = {"s1": "s1: it is too thin"}
    assert {cell: e.failures for cell, e in found.items()} == {
        ("none", "positions"): {},
        ("none", "only whole"): {},
        ("cut", "positions"): {},
        ("cut", "only whole"): boundary,
        ("thin", "positions"): thin,
        ("thin", "only whole"): boundary | thin,
    }
    assert [len(e.rows) for e in found.values()] == [6, 6, 6, 0, 4, 0]
    assert found["cut", "only whole"].summary == {}


def test_a_matcher_that_fails_leaves_the_other_matchers_alone(run):
    found = run(Positions(), matching=["nearest", "argmax"], skip_failures=True)
    assert [len(e.rows) for e in found] == [6, 0]
    assert found[0].failures == {}
    assert "needs a trained network" in found[1].failures["s0"]
    with pytest.raises(ConfigError, match="needs a trained network"):
        run(Positions(), matching=["nearest", "argmax"])


def test_features_of_the_whole_are_not_taken_for_those_of_a_part(run):
    features = PrecomputedMethod({s.name: torch.from_numpy(s.mesh.vertices.copy()) for s in shapes()})
    whole, part = run(features, perturbations={"": None, "cut": cut})
    assert len(whole.rows) == 6
    assert "wanted one row per vertex" in part.failures["s0"]


def test_plans_tasks_and_matches_reach_another_process_whole(tmp_path):
    plan = pickle.loads(pickle.dumps(a_plan(tmp_path, perturbations={"": None, "cut": cut})))
    assert plan.cells == [Cell("", "xyz", "nearest"), Cell("cut", "xyz", "nearest")]
    assert (plan.protocol, plan.store.root) == (PROTOCOL, tmp_path / "store")
    task = TargetTask(plan, "s0", ("s1", "s2"))
    assert task.pairs == [("s1", "s0"), ("s2", "s0")]
    (matched,) = matched_tasks(iter([task]), plan.memory())
    sent = pickle.loads(pickle.dumps(matched))
    assert sent.plan.shapes.names == ()
    assert len(pickle.dumps(sent)) < 100_000
    one, other = measure_target(sent), pickle.loads(pickle.dumps(measure_target(task)))
    for cell in plan.cells:
        for a, b in zip(one.pairs[cell], other.pairs[cell], strict=True):
            assert a.pair == b.pair
            np.testing.assert_array_equal(a.errors.distance, b.errors.distance)


def test_matching_keeps_what_is_there_and_says_what_it_is_kept_under(tmp_path):
    plan = a_plan(tmp_path)
    task = TargetTask(plan, "s0", ("s1",))
    (cell,) = plan.cells
    before = match_target(task, plan.memory())
    assert (list(before.points), list(before.kept), list(before.keys)) == ([cell], [], [cell])
    measure_target(task)
    after = match_target(task, plan.memory())
    assert (list(after.points), list(after.kept)) == ([], [cell])
    assert after.keys == before.keys
    nowhere = match_target(replace(task, plan=replace(plan, results=None)), plan.memory())
    assert (nowhere.keys, list(nowhere.points)) == ({}, [cell])


def test_any_process_may_match_descriptors_only(tmp_path):
    assert a_plan(tmp_path).matched_in_workers
    assert not a_plan(tmp_path, device="cuda").matched_in_workers
    assert not a_plan(tmp_path, methods={"a": nothing(shapes())}).matched_in_workers


def test_each_shape_is_read_and_described_once_in_one_process(run, monkeypatch):
    read, described = [], []

    class Counting(InMemory):
        def load(self, name):
            read.append(name)
            return super().load(name)

    class Watched(Positions):
        def describe(self, mesh, store, device="cpu"):
            described.append(mesh.name)
            return super().describe(mesh, store, device)

    run(Watched(), Counting(shapes()), matching=["nearest", Fixed(tuple(range(N)))])
    assert sorted(read) == sorted(described) == ["s0", "s1", "s2"]
    read.clear()
    run(Coordinates(), Counting(shapes()))
    assert sorted(read) == ["s0", "s0", "s1", "s1", "s2", "s2"], "once to prepare it, once to match it"


def test_a_corrupt_result_is_measured_again(run, tmp_path, caplog):
    run("xyz")
    path = next((tmp_path / "results/matched").glob("*.npz"))
    path.write_bytes(b"")
    with caplog.at_level(logging.WARNING):
        run("xyz")
    assert len(run.measured) == 1
    assert "computing it again" in caplog.text
