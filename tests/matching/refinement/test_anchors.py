from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.matching.barycentric import BarycentricMap
from csm.matching.base import Described
from csm.matching.maps import VertexMap
from csm.matching.refinement.anchors import SURE, ThereAndBack, anchored, astray, nearest_both_ways
from csm.matching.refinement.base import RefinedMap
from csm.matching.way import Way
from tests.shapes import blob

MESH = blob(2)
SAME = Described(MESH, torch.tensor(MESH.vertices))
AWAY = np.argmax(np.linalg.norm(MESH.vertices[:, None] - MESH.vertices, axis=2), axis=1)  # the farthest vertex of each


KNOWN = nearest_both_ways(SAME, SAME)


def way(indices) -> Way:
    found = VertexMap(indices, 162)
    return Way(found, precise=lambda: BarycentricMap.of_vertices(found, MESH.faces))


def test_partners_that_return_come_back_where_a_refinement_took_them_away():
    indices = np.arange(162)
    indices[:20] = AWAY[:20]
    found = anchored(RefinedMap(way(indices), way(indices), "done"), SAME, SAME, KNOWN)
    for each in (found.forward, found.backward):
        np.testing.assert_array_equal(each.vertex_map.indices, np.arange(162))
        np.testing.assert_array_equal(each.barycentric.vertex_map().indices, np.arange(162))
    assert found.text == "done"


def test_a_refinement_that_changes_nothing_stays_as_it_is():
    start = way(np.arange(162))
    assert anchored(RefinedMap(start), SAME, SAME, KNOWN).forward is start


def test_partners_that_do_not_return_are_the_business_of_the_refinement():
    features = SAME.features.clone()
    features[0] = features[AWAY[0]] + 0.01  # the descriptor sees this vertex elsewhere, and no way leads back
    indices = np.arange(162)
    source = Described(MESH, features)
    found = anchored(RefinedMap(way(indices)), source, SAME, nearest_both_ways(source, SAME))
    np.testing.assert_array_equal(found.forward.vertex_map.indices, indices)


@pytest.mark.parametrize("backward", [True, False])
def test_a_refinement_without_a_way_back_keeps_none(backward):
    done = RefinedMap(way(np.arange(162)), way(np.arange(162)) if backward else None)
    assert (anchored(done, SAME, SAME, KNOWN).backward is not None) == backward


def test_no_partner_stays_none():
    indices = np.arange(162)
    indices[:20] = -1
    found = VertexMap(indices, 162)
    assert (anchored(RefinedMap(Way(found)), SAME, SAME, KNOWN).forward.vertex_map.indices[:20] == -1).all()


def test_vertices_are_astray_by_how_far_they_return_and_no_farther_than_is_sure():
    assert astray(KNOWN, SAME, SAME) == 0
    there = np.arange(162)
    there[:81] = AWAY[:81]
    found = ThereAndBack(VertexMap(there, 162), KNOWN.back)
    assert astray(found, SAME, SAME) == pytest.approx(0.5 * SURE)
    assert astray(ThereAndBack(found.back, found.there), SAME, SAME) == pytest.approx(0.5 * SURE)
