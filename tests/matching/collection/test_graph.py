from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest

from csm.errors import ConfigError
from csm.matching.collection.graph import pairs_of, triangles_of


def distances(n: int) -> np.ndarray:
    points = np.random.default_rng(n).random((n, 3))
    return np.linalg.norm(points[:, None] - points, axis=-1)


@pytest.mark.parametrize(("n", "near", "far"), [(2, 1, 0), (9, 2, 1), (30, 3, 2), (30, 0, 0)])
def test_the_graph_is_connected_and_every_shape_has_its_nearest_ones(n, near, far):
    apart = distances(n)
    pairs = pairs_of(apart, near, far)
    graph = nx.Graph(pairs.tolist())
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert nx.is_connected(graph)
    assert set(graph) == set(range(n))
    for i in range(n):
        assert set(np.argsort(apart[i])[1 : 1 + near].tolist()) <= set(graph[i])
        assert graph.degree(i) >= min(n - 1, near + far)


def test_groups_that_are_not_joined_are_joined_where_they_are_nearest():
    at = np.array([0.0, 1, 2, 10, 11, 12])
    assert [2, 3] in pairs_of(abs(at[:, None] - at), 1, 0).tolist()


def test_all_shapes_near_is_the_complete_graph():
    assert pairs_of(distances(7), 7, 0).tolist() == [list(pair) for pair in combinations(range(7), 2)]


@pytest.mark.parametrize(("n", "near", "far"), [(1, 1, 1), (3, -1, 0)])
def test_what_is_no_graph_is_refused(n, near, far):
    with pytest.raises(ConfigError, match="wanted 2 shapes"):
        pairs_of(distances(n), near, far)


def test_triangles_are_those_of_brute_force():
    pairs = pairs_of(distances(12), 3, 1)
    edges = [tuple(pair) for pair in pairs.tolist()]
    wanted = {
        (edges.index((i, j)), edges.index((j, k)), edges.index((i, k)))
        for i, j, k in combinations(range(12), 3)
        if {(i, j), (j, k), (i, k)} <= set(edges)
    }
    assert wanted
    assert {tuple(row) for row in triangles_of(pairs, 12).tolist()} == wanted
