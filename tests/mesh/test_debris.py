import numpy as np
import pytest

from csm.mesh.debris import DEBRIS, body_of, component_areas
from csm.mesh.shape import Mesh
from tests.shapes import blob, plane, sphere


def scattered(mesh: Mesh, n: int, size: float, seed: int = 0) -> tuple[Mesh, np.ndarray]:
    """Return a mesh among `n` specks and a lone vertex, shuffled, and the new number of each of its vertices."""
    rng = np.random.default_rng(seed)
    specks = (rng.normal(size=(n, 1, 3)) + size * rng.normal(size=(n, 3, 3))).reshape(-1, 3)
    vertices = np.vstack([mesh.vertices, specks, [[7.0, 7.0, 7.0]]])
    faces = np.vstack([mesh.faces, mesh.n_vertices + np.arange(3 * n).reshape(n, 3)])
    number = rng.permutation(len(vertices))
    shuffled = np.empty_like(vertices)
    shuffled[number] = vertices
    return Mesh(shuffled, number[faces][rng.permutation(len(faces))], "scattered"), number[: mesh.n_vertices]


def test_the_body_is_what_was_there_before_the_debris():
    mesh, kept = scattered(blob(3), 40, 1e-3)
    body = body_of(mesh)
    assert sorted(np.flatnonzero(body.vertices)) == sorted(kept)
    assert (body.n_components, body.n_debris) == (1, 40)
    assert body.area == pytest.approx(blob(3).area, rel=1e-12)
    assert "40 components of less than 1% of the area" in body.note


def test_components_of_some_size_all_belong():
    ball = sphere(2)
    two = Mesh(
        np.vstack([ball.vertices, 0.2 * ball.vertices + 4]), np.vstack([ball.faces, ball.faces + ball.n_vertices])
    )
    body = body_of(two)
    assert body.is_all
    assert body.n_components == 2
    assert body.note == ""
    areas = component_areas(two)[1]
    assert areas[1] / areas.sum() > DEBRIS


def test_where_all_components_are_small_none_is_debris():
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    vertices = np.concatenate([triangle * (1.5 if i == 130 else 1) + 3 * i for i in range(200)])
    mesh = Mesh(vertices, np.arange(600).reshape(200, 3))
    assert body_of(mesh).is_all
    assert np.flatnonzero(body_of(mesh, together=1.0).vertices).tolist() == [390, 391, 392], "the largest always counts"


def test_a_point_cloud_has_no_body():
    body = body_of(Mesh(plane().vertices, np.zeros((0, 3), int)))
    assert not body.vertices.any()
    assert body.area == 0


def test_many_small_parts_are_the_shape_and_no_debris():
    ball = sphere(2)
    bolts = [0.06 * ball.vertices + [3 + i, 0, 0] for i in range(40)]  # 0.4 % of the ball's area each
    dust = [0.001 * ball.vertices + [0, 3 + i, 0] for i in range(5)]
    vertices = np.concatenate([ball.vertices, *bolts, *dust])
    faces = np.concatenate([ball.faces + i * ball.n_vertices for i in range(46)])
    body = body_of(Mesh(vertices, faces))
    assert (body.n_components, body.n_debris) == (41, 5)
    assert body.vertices[: 41 * ball.n_vertices].all()
    assert body_of(Mesh(vertices, faces), 0.01, together=1.0).n_components == 1
