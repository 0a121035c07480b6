from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.data.datasets import find_set
from csm.data.folderset import FolderSet
from csm.data.prepare import compute_features
from csm.data.store import Store
from csm.descriptors import preset
from csm.evaluation.matching import nearest
from csm.evaluation.protocol import Protocol, evaluate_matches
from csm.evaluation.results import summarise
from csm.mesh.io import write_mesh
from csm.studies import matching
from csm.studies.matching import Rules, match_pairs
from tests.remeshedset import write_faust

DESCRIPTORS = {"acd": preset("acd_paper", angles=4), "amks": preset("amks", k=20, n_energies=10)}


@pytest.fixture
def faust(tmp_path) -> FolderSet:
    return find_set(write_faust(tmp_path / "FAUST"), "FAUST_5k_remeshed")


@pytest.fixture
def stores(tmp_path) -> tuple[Store, Store]:
    return Store(tmp_path / "store"), Store(tmp_path / "parts")


def rules(shapes: FolderSet, exact_points: int | None = None, **options: int) -> Rules:
    return Rules(Protocol(shapes.mapped_pairs, **options), exact_points)


@pytest.mark.parametrize("points", [None, 50])
def test_all_points_exactly_agree_with_the_evaluation_of_each_descriptor_alone(faust, stores, points):
    asked = rules(faust, points=points)
    found, failures = match_pairs(faust, faust.mapped_pairs, DESCRIPTORS, asked, stores, 0)
    assert failures == {}
    shapes = [faust.load(name) for name in faust.names]
    for name, descriptor in DESCRIPTORS.items():
        features = {s.name: compute_features(s.mesh, descriptor, stores[0]) for s in shapes}
        wanted = evaluate_matches(
            shapes, lambda a, b, f=features: nearest(f[a.name], f[b.name]), asked.protocol, progress=False
        )
        mine = summarise([pair for target in found[name] for pair in target.pairs], asked.protocol, 0.0)
        rows = {(row.source, row.target): row for row in mine.rows}
        for row in wanted.rows:
            other = rows[row.source, row.target]
            assert other.age == pytest.approx(row.age, rel=1e-6)
            assert (other.points, other.exact, other.coverage) == (row.points, row.exact, row.coverage)
            assert other.flip == pytest.approx(row.flip, abs=0.05)


def test_what_is_kept_is_not_measured_again_and_another_question_is(faust, stores, monkeypatch):
    asked = []
    honest = matching.errors_on_target
    monkeypatch.setattr(
        matching, "errors_on_target", lambda t, q, n: asked.append({x.descriptor for x in q}) or honest(t, q, n)
    )
    pairs = faust.mapped_pairs[:2]
    first, _ = match_pairs(faust, pairs, {"acd": DESCRIPTORS["acd"]}, rules(faust, 20), stores, 0)
    match_pairs(faust, pairs, DESCRIPTORS, rules(faust, 20), stores, 0)
    again, _ = match_pairs(faust, pairs, DESCRIPTORS, rules(faust, 20), stores, 0)
    assert asked == [{"acd"}, {"acd"}, {"amks"}, {"amks"}]
    for one, other in zip(first["acd"], again["acd"], strict=True):
        assert one.variances == other.variances
        np.testing.assert_array_equal(one.pairs[0].errors.distance, other.pairs[0].errors.distance)
    match_pairs(faust, pairs[:1], DESCRIPTORS, rules(faust, 21), stores, 0)
    match_pairs(faust, pairs[:1], DESCRIPTORS, rules(faust, 21, points=90), stores, 0)
    match_pairs(faust, pairs[:1], {"acd": preset("acd_paper", angles=3)}, rules(faust, 20), stores, 0)
    assert len(asked) == 7


def test_a_target_that_cannot_be_measured_is_named_and_the_others_are_done(faust, stores):
    mesh = faust.mesh("tr_reg_011")
    fin = [*mesh.faces[0, :2], mesh.faces[100, 0]]
    write_mesh(faust.entry("tr_reg_011").mesh, replace(mesh, faces=np.vstack([mesh.faces, [fin]])))
    found, failures = match_pairs(faust, faust.mapped_pairs, DESCRIPTORS, rules(faust, 20), stores, 0)
    assert list(failures) == ["tr_reg_011"]
    assert [target.pairs[0].pair[1] for target in found["acd"]] == ["tr_reg_001", "tr_reg_000"]
