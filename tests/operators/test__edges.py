from __future__ import annotations

import numpy as np

from csm.operators._edges import interior_edges, longest_edge_basis
from tests.shapes import cylinder, sphere


def test_every_interior_edge_runs_along_its_left_face_and_back_along_its_right():
    mesh = cylinder(n=7, m=4)  # with a boundary
    edges = interior_edges(mesh)
    assert len(edges.tail) == (3 * mesh.n_faces - 2 * 7) / 2
    for tail, head, left, right in zip(edges.tail, edges.head, edges.left, edges.right, strict=True):
        forward = {tuple(np.roll(mesh.faces[left], -i)[:2]) for i in range(3)}
        backward = {tuple(np.roll(mesh.faces[right], -i)[:2]) for i in range(3)}
        assert (tail, head) in forward
        assert (head, tail) in backward


def test_angles_of_a_convex_body_are_positive_and_those_of_its_inside_negative():
    mesh = sphere(1)
    assert (interior_edges(mesh).angle > 0).all()
    turned = type(mesh)(mesh.vertices, mesh.faces[:, ::-1])
    assert (interior_edges(turned).angle < 0).all()


def test_the_longest_edge_spans_the_basis():
    mesh = cylinder()
    basis = longest_edge_basis(mesh)
    normal = mesh.face_crosses / np.linalg.norm(mesh.face_crosses, axis=1, keepdims=True)
    np.testing.assert_allclose(np.cross(basis.e1, basis.e2), normal, atol=1e-12)
