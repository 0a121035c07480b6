from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from csm.matching import VertexMap
from csm.matching.base import Described
from csm.matching.calibration import Calibration
from csm.matching.confidence import (
    AMBIGUOUS,
    TRUSTED,
    Confidence,
    confidence_of,
    refined_probability,
    share_returning,
    there_and_back,
)
from csm.matching.signals import NEAR, OF_MAPS, OF_REFINED, Sides
from tests.shapes import blob, sphere


def test_a_map_and_its_inverse_return_everything():
    ball = sphere(2)
    there = np.random.default_rng(0).permutation(ball.n_vertices)
    assert not there_and_back(VertexMap(there, 162), VertexMap(np.argsort(there), 162), ball).any()


def test_distances_are_in_units_of_the_root_of_the_area_and_inf_without_a_match():
    ball = sphere(2, radius=3.0)
    there = np.where(np.arange(162) == 5, -1, 0)
    found = there_and_back(VertexMap(there, 162), VertexMap(np.full(162, 7), 162), ball)
    wanted = np.linalg.norm(ball.vertices - ball.vertices[7], axis=1) / np.sqrt(ball.area)
    np.testing.assert_allclose(np.delete(found, 5), np.delete(wanted, 5))
    assert np.isinf(found[5])


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (0.95, "95 % of the source has a trustworthy partner (a confidence of 0.5 or more)"),
        (0.7, "about a third of the source has no trustworthy partner: limbs may"),
        (0.3, "WARNING: about two thirds of the source has no"),
        (0.0, "WARNING: almost all of the source has no"),
    ],
)
def test_the_verdict_gets_worse_as_fewer_can_be_trusted(share, said):
    values = np.where(np.arange(100) < 100 * share, TRUSTED, TRUSTED - 0.1)
    found = Confidence(values, np.zeros(100))
    assert said in found.verdict
    assert found.trusted == pytest.approx(share)


@pytest.mark.parametrize(("confidence", "said"), [(1.0, "or more)"), (0.96, "about one in 25 may still be wrong")])
def test_the_verdict_says_how_many_may_be_wrong_although_all_are_trusted(confidence, said):
    verdict = Confidence(np.full(100, confidence), np.zeros(100)).verdict
    assert verdict.startswith("all of the source has a trustworthy partner")
    assert verdict.endswith(said)


def test_the_verdict_warns_where_a_search_found_nothing_that_fits():
    sure = Confidence(np.ones(3), np.zeros(3), ambiguous=True, strained=True).verdict
    assert sure.startswith("all of the source has")
    assert sure.index(AMBIGUOUS) < sure.index("; WARNING: even the best map that was found keeps areas")


def test_returning_counts_what_is_matched():
    distance = np.array([0.5 * NEAR, 3 * NEAR, np.inf, 0.0])
    assert Confidence(np.zeros(4), distance).returned == pytest.approx(2 / 3)
    assert Confidence(np.zeros(3), np.full(3, np.inf)).returned == 0


def test_a_true_map_is_believed_more_than_a_random_one_and_no_partner_not_at_all():
    ball = blob(3)
    n = ball.n_vertices
    described = Described(ball, torch.tensor(ball.vertices))
    identity, mixed = np.arange(n), np.random.default_rng(0).permutation(n)
    true = VertexMap(np.where(identity == 7, -1, identity), n)
    good = confidence_of(Sides(described, described, true, VertexMap(identity, n)))
    bad = confidence_of(Sides(described, described, VertexMap(mixed, n), VertexMap(mixed, n)))
    assert good.values[7] == 0
    assert np.median(good.values) > 0.9 > 0.3 > np.median(bad.values)
    refined = Sides(described, described, VertexMap(identity, n), VertexMap(identity, n))
    wrong = Sides(described, described, VertexMap(mixed, n), VertexMap(np.argsort(mixed), n))
    assert np.median(confidence_of(refined, refined.forward).values) > 0.9
    assert np.median(confidence_of(wrong, refined.forward).values) < 0.3  # it returns, but nothing else speaks for it


def test_descriptors_that_know_their_place_return():
    ball = blob(3)
    here = torch.tensor(ball.vertices)
    tried = np.arange(0, ball.n_vertices, 3)
    assert share_returning(ball, tried, here, here) == 1.0
    assert share_returning(ball, tried, here, here[:1].repeat(50, 1)) < 0.1


def test_what_does_not_return_is_not_believed_whatever_else_speaks_for_it():
    names = (*OF_MAPS, *OF_REFINED)
    sure = Calibration(names, (0.0,) * 12, (1.0,) * 12, (0.0,) * 12, 9.0)
    signals = np.zeros((3, 12))
    signals[:, OF_MAPS.index("back")] = [0.0, 0.5 * NEAR, 3 * NEAR]
    found = refined_probability(sure, signals)
    assert found[0] > 0.99
    assert 0.7 < found[1] < 0.8
    assert found[2] < 0.001


def test_all_is_said_of_all_only():
    assert Confidence(np.ones(1000), np.zeros(1000)).verdict.startswith("all of the source")
    assert Confidence(np.r_[np.ones(999), 0.0], np.zeros(1000)).verdict.startswith("99 % of the source")


def test_the_verdict_on_symmetric_shapes_says_that_there_are_other_maps():
    plain = Confidence(np.ones(9), np.zeros(9))
    assert "several" not in plain.verdict
    symmetric = replace(plain, ambiguous=True).verdict
    assert symmetric == (
        f"{plain.verdict}; the shapes look the same in several ways, such as turned or mirrored, and the map is one of "
        "several equally good ones"
    )
