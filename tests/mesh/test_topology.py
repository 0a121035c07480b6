"""Edges and components against loops over faces and networkx."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from csm.mesh.topology import components, directed_edges, edge_graph, edge_keys, half_edges
from tests.shapes import blob, cylinder, plane, sphere

BOOK = np.array([[0, 1, 2], [0, 1, 3], [1, 0, 4], [5, 5, 6]])
"""Three faces at one edge, and a face that names a vertex twice."""

FACES = {"blob": blob(2).faces, "cylinder": cylinder().faces, "plane": plane().faces, "book": BOOK}
each = pytest.mark.parametrize("faces", FACES.values(), ids=FACES)


def sides(faces: np.ndarray) -> list[tuple[int, int]]:
    return [(int(face[k]), int(face[(k + 1) % 3])) for face in faces for k in range(3)]


def graph_of(faces: np.ndarray) -> nx.Graph:
    graph = nx.Graph(sides(faces))
    graph.add_nodes_from(range(int(faces.max()) + 1))
    return graph


@each
def test_half_edges_are_the_sides_face_by_face(faces):
    found = half_edges(faces)
    assert list(zip(found.tails, found.heads, strict=True)) == sides(faces)


@each
def test_keys_are_equal_for_the_two_directions_of_an_edge_only(faces):
    tails, heads = half_edges(faces)
    n = faces.max() + 1
    keys = edge_keys(tails, heads, n)
    np.testing.assert_array_equal(keys, edge_keys(heads, tails, n))
    assert len(set(keys)) == len({frozenset(side) for side in sides(faces)})
    assert [divmod(key, n) for key in keys] == [tuple(sorted(side)) for side in sides(faces)]


@each
def test_directed_edges_are_both_directions_once_and_in_order(faces):
    found = directed_edges(faces, int(faces.max()) + 1)
    both = {*sides(faces), *(side[::-1] for side in sides(faces))}
    assert list(zip(found.targets, found.sources, strict=True)) == sorted(both)


@each
def test_the_graph_has_every_edge_at_its_length(faces):
    vertices = np.random.default_rng(0).normal(size=(faces.max() + 1, 3))
    graph = edge_graph(vertices, faces)
    expected = {(i, j): np.linalg.norm(vertices[i] - vertices[j]) for i, j in sides(faces) if i != j}
    expected |= {(j, i): length for (i, j), length in expected.items()}
    dense = np.zeros((len(vertices), len(vertices)))
    dense[tuple(np.transpose(list(expected)))] = list(expected.values())
    np.testing.assert_allclose(graph.toarray(), dense, rtol=1e-14)
    assert graph.nnz == len(expected)


def test_coincident_neighbours_stay_joined():
    mesh = blob(2)
    vertices = mesh.vertices.copy()
    vertices[mesh.faces[0, 1]] = vertices[mesh.faces[0, 0]]
    way = dijkstra(edge_graph(vertices, mesh.faces), indices=[mesh.faces[0, 0]])[0]
    assert 0 < way[mesh.faces[0, 1]] < 1e-300
    assert np.isfinite(way).all()


@each
def test_components_are_those_of_networkx_in_the_order_of_their_first_nodes(faces):
    n = int(faces.max()) + 1
    label = components(*half_edges(faces), n)
    expected = sorted(nx.connected_components(graph_of(faces)), key=min)
    assert [set(np.flatnonzero(label == k)) for k in range(label.max() + 1)] == expected


def test_nodes_without_edges_are_components_of_their_own():
    one = sphere(1)
    np.testing.assert_array_equal(components(*half_edges(one.faces), one.n_vertices + 2)[-3:], [0, 1, 2])
