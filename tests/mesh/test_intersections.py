from __future__ import annotations

import numpy as np
import pytest

from csm.mesh.intersections import intersecting_pairs
from tests.shapes import sphere


def test_a_sphere_does_not_cut_through_itself():
    ball = sphere(3)
    assert len(intersecting_pairs(ball.vertices, ball.faces)) == 0


@pytest.mark.parametrize(("apart", "meets"), [(1.9, True), (2.1, False)])
def test_two_spheres_intersect_where_they_overlap(apart, meets):
    ball = sphere(3)
    n = ball.n_vertices
    vertices = np.concatenate([ball.vertices, ball.vertices + np.array([apart, 0, 0])])
    pairs = intersecting_pairs(vertices, np.concatenate([ball.faces, ball.faces + n]))
    assert (len(pairs) > 0) == meets
    first, second = np.sort(pairs, axis=1).T
    assert (first < ball.n_faces).all()
    assert (second >= ball.n_faces).all()
    assert abs(vertices[ball.faces[first]].mean(axis=1)[:, 0] - apart / 2).max(initial=0) < 0.3


def test_a_small_triangle_through_a_large_one_is_found():
    vertices = np.array([[0, 0, 0], [100, 0, 0], [0, 100, 0], [20, 20, -0.1], [20, 20, 0.1], [20.1, 20, 0.1]])
    assert intersecting_pairs(vertices, np.array([[0, 1, 2], [3, 4, 5]])).tolist() == [[0, 1]]
