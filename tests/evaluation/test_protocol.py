"""Which pairs and points a protocol chooses, what it says, and what it refuses."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from csm.data.shapes import InMemory, Shape
from csm.data.store import Store
from csm.errors import ConfigError, DataError, MeshError
from csm.evaluation import EvaluationProtocol
from csm.evaluation.engine import evaluate
from csm.matching import PrecomputedMethod
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from tests.evaluation.toys import N, to_shape
from tests.shapes import sphere

WHOLE = to_shape(np.arange(N))
PART = to_shape(np.where(np.arange(N) % 3 == 0, -1, np.arange(N)))


def test_pairs_are_all_or_listed_or_drawn() -> None:
    names = ["a", "b", "c", "d"]
    everything = EvaluationProtocol().choose(names)
    assert len(everything) == 12
    assert all(s != t for s, t in everything)
    assert EvaluationProtocol(pairs=[("a", "b"), ("a", "a")]).choose(names) == [("a", "b"), ("a", "a")]
    drawn = EvaluationProtocol(sample=5, seed=3).choose(names)
    assert drawn == EvaluationProtocol(sample=5, seed=3).choose(names)
    assert len(set(drawn)) == 5
    assert set(drawn) <= set(everything)
    assert any(EvaluationProtocol(sample=5, seed=seed).choose(names) != drawn for seed in range(4))
    assert EvaluationProtocol(sample=50).choose(names) == everything
    of_a_list = EvaluationProtocol(pairs=everything[:4], sample=2, seed=1).choose(names)
    assert len(of_a_list) == 2
    assert set(of_a_list) <= set(everything[:4])


def test_pairs_that_there_are_not_are_named() -> None:
    with pytest.raises(DataError, match="names 'y' and 1 more that are not among the 1 shape"):
        EvaluationProtocol(pairs=[("a", "y"), ("z", "a")]).choose(["a"])
    with pytest.raises(DataError, match="no pair to evaluate: 1 shape"):
        EvaluationProtocol().choose(["a"])


def test_all_points_known_on_both_are_measured_exactly() -> None:
    found = EvaluationProtocol().points_of(WHOLE, PART)
    np.testing.assert_array_equal(found.template, np.flatnonzero(np.arange(N) % 3))
    assert found.exact.all()


def test_the_drawn_template_points_are_the_same_in_every_pair() -> None:
    protocol = EvaluationProtocol(points=50, seed=1)
    alone, part = protocol.points_of(WHOLE, WHOLE), protocol.points_of(PART, WHOLE)
    np.testing.assert_array_equal(alone.template, np.sort(np.random.default_rng(1).permutation(N)[:50]))
    np.testing.assert_array_equal(part.template, alone.template[alone.template % 3 > 0])
    np.testing.assert_array_equal(protocol.points_of(WHOLE, PART).template, part.template)
    assert len(EvaluationProtocol(points=N + 1).points_of(WHOLE, WHOLE).template) == N


def test_points_drawn_for_a_pair_are_as_many_as_there_can_be() -> None:
    protocol = EvaluationProtocol(points=50, seed=1, drawn="pair")
    common = np.flatnonzero(np.arange(N) % 3)
    expected = np.sort(common[np.random.default_rng(1).permutation(len(common))[:50]])
    np.testing.assert_array_equal(protocol.points_of(WHOLE, PART).template, expected)
    few = EvaluationProtocol(points=150, drawn="pair").points_of(WHOLE, PART)
    np.testing.assert_array_equal(few.template, common)


def test_points_that_a_perturbation_has_cut_away_are_not_measured() -> None:
    left = np.arange(N) >= 100
    for protocol in (EvaluationProtocol(), EvaluationProtocol(points=40), EvaluationProtocol(points=40, drawn="pair")):
        found = protocol.points_of(WHOLE, PART, left).template
        assert found.min() >= 100
        assert not (found % 3 == 0).any()
    assert len(EvaluationProtocol(points=30, drawn="pair").points_of(WHOLE, PART, left).template) == 30


def test_points_measured_exactly_are_drawn_among_those_known_on_the_target() -> None:
    protocol = EvaluationProtocol(exact_points=50, seed=1)
    whole, part = protocol.points_of(WHOLE, WHOLE), protocol.points_of(PART, WHOLE)
    assert whole.exact.sum() == 50
    np.testing.assert_array_equal(part.exact, whole.exact[PART.indices >= 0])
    assert protocol.points_of(WHOLE, PART).exact.sum() == 50
    few = EvaluationProtocol(points=60, exact_points=20, seed=1).points_of(WHOLE, WHOLE)
    assert (len(few.template), few.exact.sum()) == (60, 20)
    assert EvaluationProtocol(exact_points=9 * N).points_of(WHOLE, WHOLE).exact.all()


def test_a_template_of_two_points_for_one_vertex_measures_both() -> None:
    twice = to_shape(np.where(np.arange(N) == 5, 4, np.arange(N)))
    assert {4, 5} <= set(EvaluationProtocol().points_of(WHOLE, twice).template)


@pytest.mark.parametrize(
    ("protocol", "said"),
    [
        (EvaluationProtocol(), ["all ordered pairs without self-pairs", "exact geodesic", "geodesic diameter"]),
        (
            EvaluationProtocol(pairs=[("a", "b")], distance="edge", normaliser="sqrt_area"),
            ["given list", "edges", "square root"],
        ),
        (EvaluationProtocol(sample=7, seed=4, distance="heat"), ["7 pairs", "seed 4", "heat"]),
        (EvaluationProtocol(points=40, seed=3), ["those of 40 (drawn with seed 3) template points"]),
        (EvaluationProtocol(points=40, seed=3, drawn="pair"), ["40 of the template points", "(drawn with seed 3)"]),
        (EvaluationProtocol(exact_points=9), ["of which 9 per target exactly", "scaled paths along edges"]),
    ],
)
def test_describe_says_every_fact(protocol: EvaluationProtocol, said: list[str]) -> None:
    assert all(words in protocol.describe() for words in [*said, "pooled", "known on both"])


def test_the_words_are_those_of_results_that_are_there() -> None:
    """Cells of a matrix are recognised by them, so that another word means that all of it is measured again."""
    assert EvaluationProtocol(points=100).describe(380) == (
        "380 pairs (all ordered pairs without self-pairs); error = exact geodesic distance on the target from the "
        "true to the matched vertex, divided by the geodesic diameter of the target (of the same distance; a lower "
        "bound by sweeps); mean over those of 100 (drawn with seed 0) template points known on both shapes, pooled "
        "over pairs; a match on another component counts as one diameter; left-right flip: nearer to the mirrored "
        "truth by more than 0.05."
    )
    assert "; mean over all template points known on both shapes, pooled" in EvaluationProtocol().describe(2)


@pytest.mark.parametrize(
    "bad",
    [
        {"distance": "far"},
        {"normaliser": "volume"},
        {"drawn": "shape"},
        {"pairs": "some"},
        {"pairs": None},
        {"pairs": ["ab", "cd"]},
        {"pairs": [("a", "b", "c")]},
        {"sample": 0},
        {"points": 0},
        {"points": 2.5},
        {"points": "3"},
        {"seed": None},
        {"seed": -1},
        {"exact_points": 0},
        {"exact_points": 5, "distance": "edge"},
        {"exact_points": 5, "points": 9, "drawn": "pair"},
    ],
)
def test_protocols_that_cannot_work(bad: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=f"protocol: {next(iter(bad))}="):
        EvaluationProtocol(**bad)  # type: ignore[arg-type]


def test_pairs_may_come_from_a_generator() -> None:
    protocol = EvaluationProtocol(pairs=((a, b) for a, b in ["ab", "ba"]))
    assert protocol.choose(["a", "b"]) == protocol.choose(["a", "b"]) == [("a", "b"), ("b", "a")]


def test_a_pair_that_is_named_twice_is_measured_once_and_said(caplog) -> None:
    protocol = EvaluationProtocol(pairs=[("a", "b"), ("b", "a"), ("a", "b")])
    assert protocol.choose(["a", "b"]) == [("a", "b"), ("b", "a")]
    assert caplog.messages == ["protocol: the pair a -> b is named several times; each is measured once"]
    caplog.clear()
    EvaluationProtocol(pairs=protocol.pairs)
    assert not caplog.messages


def test_a_protocol_survives_pickling() -> None:
    protocol = EvaluationProtocol(pairs=[("a", "b")], points=3, exact_points=2)
    assert pickle.loads(pickle.dumps(protocol)) == protocol


def test_only_shapes_of_one_template_make_a_pair() -> None:
    templates = {"s0": "cat", "s1": "cat", "s2": "dog"}
    assert EvaluationProtocol().choose(list(templates), templates) == [("s0", "s1"), ("s1", "s0")]
    with pytest.raises(DataError, match=r"s0 -> s2 and 0 more whose maps start from different templates"):
        EvaluationProtocol(pairs=[("s0", "s2")]).choose(list(templates), templates)
    with pytest.raises(DataError, match="'s3' and 0 more of the shapes have no known correspondence"):
        EvaluationProtocol().choose(["s0", "s1", "s3"], templates)


def test_a_name_that_is_given_twice_is_refused() -> None:
    with pytest.raises(DataError, match="3 shapes have only 2 different names; 's1' is there twice"):
        EvaluationProtocol().choose(["s0", "s1", "s1"])


def with_a_fin(mesh: Mesh) -> Mesh:
    a, b, _ = mesh.faces[0]
    vertices = np.vstack([mesh.vertices, 1.5 * mesh.vertices[a]])
    return Mesh(vertices, np.vstack([mesh.faces, [[a, b, mesh.n_vertices]]]), "finned")


def test_where_exact_distances_are_impossible_another_kind_is_taken_if_it_is_allowed(caplog):
    exact, heat = EvaluationProtocol(), EvaluationProtocol(fallback="heat")
    assert exact.distance_on(with_a_fin(sphere(2))) == "exact"
    assert heat.distance_on(sphere(2)) == "exact"
    assert caplog.text == ""
    assert heat.distance_on(with_a_fin(sphere(2))) == "heat"
    assert "finned: is no manifold, so its distances are measured by the method 'heat'" in caplog.text
    assert "no manifold: geodesic distance by the heat method" in heat.describe()
    assert "manifold" not in exact.describe()
    with pytest.raises(ConfigError, match="fallback='exact'"):
        EvaluationProtocol(fallback="exact")


def test_a_set_with_fins_is_measured_with_the_fallback_and_refused_without(tmp_path):
    finned = with_a_fin(sphere(2))
    other = Mesh(finned.vertices * [1, 1.2, 0.9], finned.faces, "other")
    truth = PointMap.identity(finned.n_vertices, finned.n_vertices)
    shapes = InMemory([Shape(finned, truth), Shape(other, truth)], "fins")
    method = PrecomputedMethod({m.name: m.vertices for m in (finned, other)})
    options = {"store": Store(tmp_path), "workers": 1, "progress": False}
    with pytest.raises(MeshError, match="exact geodesics need a manifold"):
        evaluate(method, shapes, EvaluationProtocol(), **options)
    (found,) = evaluate(method, shapes, EvaluationProtocol(fallback="edge"), **options)
    assert np.isfinite(found.summary["age"])
