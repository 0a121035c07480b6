from __future__ import annotations

import numpy as np
import pytest

from csm.mesh.shape import Mesh
from csm.operators.fans import Fans, fans
from tests.shapes import blob, cylinder, plane


def directions_at(found: Fans, vertex: int) -> dict[int, float]:
    at = found.tails == vertex
    return dict(zip(found.heads[at].tolist(), found.directions[at].tolist(), strict=True))


def neighbours(mesh: Mesh, vertex: int) -> set[int]:
    return {int(v) for face in mesh.faces if vertex in face for v in face} - {vertex}


def angle(mesh: Mesh, at: int, a: int, b: int) -> float:
    u, v = mesh.vertices[a] - mesh.vertices[at], mesh.vertices[b] - mesh.vertices[at]
    return float(np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)))


@pytest.mark.parametrize("mesh", [blob(1), plane(6), cylinder(n=8, m=4)], ids=lambda m: m.name)
def test_every_edge_has_a_direction_and_faces_are_scaled_angles(mesh):
    found = fans(mesh)
    for vertex in range(mesh.n_vertices):
        directions = directions_at(found, vertex)
        assert set(directions) == neighbours(mesh, vertex)
        steps = []
        for face in mesh.faces[(mesh.faces == vertex).any(axis=1)]:
            _, a, b = np.roll(face, -int(np.flatnonzero(face == vertex)[0])).tolist()
            steps.append((np.mod(directions[b] - directions[a], 2 * np.pi), angle(mesh, vertex, a, b)))
        turned, inside = np.array(steps).T
        closed = len(steps) == len(directions)
        np.testing.assert_allclose(turned, inside * (2 * np.pi / inside.sum() if closed else 1))


def test_the_longest_edge_leads():
    mesh = blob(1)
    found = fans(mesh)
    for vertex in range(mesh.n_vertices):
        directions = directions_at(found, vertex)
        longest = max(directions, key=lambda v: np.linalg.norm(mesh.vertices[v] - mesh.vertices[vertex]))
        assert directions[longest] == 0


def test_directions_on_a_plane_are_those_of_the_plane():
    mesh = plane(8)
    found = fans(mesh)
    step = mesh.vertices[found.heads] - mesh.vertices[found.tails]
    np.testing.assert_allclose(found.lengths, np.linalg.norm(step, axis=1))
    turn = np.exp(1j * (np.arctan2(step[:, 1], step[:, 0]) - found.directions))
    for vertex in range(mesh.n_vertices):
        at = turn[found.tails == vertex]
        np.testing.assert_allclose(at, at[0], atol=1e-9)


def test_corners_are_listed_by_vertex():
    mesh = plane(6)
    found = fans(mesh)
    for vertex, row in enumerate(found.corners):
        corners = row[row >= 0]
        assert sorted(corners) == sorted(np.flatnonzero(mesh.faces.ravel() == vertex))
        assert (mesh.faces.ravel()[corners] == vertex).all()
    others = np.stack([mesh.faces.ravel(), found.following, found.preceding], axis=1)
    np.testing.assert_array_equal(np.sort(others, axis=1), np.sort(np.repeat(mesh.faces, 3, axis=0), axis=1))


def test_of_two_fans_at_a_vertex_one_counts():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1.5, 0]], dtype=float)
    found = fans(Mesh(points, np.array([[0, 1, 2], [0, 3, 4]])))
    assert set(directions_at(found, 0)) in ({1, 2}, {3, 4})
