from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from csm.learning.places import Reading
from csm.learning.sides import LEAST, mended
from csm.mesh.shape import Mesh
from csm.operators.laplacian import vertex_areas
from csm.operators.operators import Operators
from tests.shapes import sphere


@pytest.fixture(scope="module")
def body():
    """A body with two arms and a head, the same on both sides of the plane x = 0."""
    ball = sphere(4)
    x = ball.vertices
    bumps = [(3.0, (0.95, 0.3, 0.1)), (3.0, (-0.95, 0.3, 0.1)), (0.8, (0.0, 0.9, -0.4))]
    size = 1 + sum(height * np.exp(30 * (x @ np.array(at) / np.linalg.norm(at) - 1)) for height, at in bumps)
    return Mesh(x * size[:, None], ball.faces, "body")


@pytest.fixture(scope="module")
def twins(body):
    apart, at = cKDTree(body.vertices).query(body.vertices * [-1, 1, 1])
    assert apart.max() < 1e-6
    return at


@pytest.fixture(scope="module")
def rows(body):
    return Operators(body).lbo(60).evecs


def reading(body, rows, at):
    values = rows[at], body.vertices[at], body.vertex_normals[at]
    return Reading(*(torch.as_tensor(np.ascontiguousarray(x)).float() for x in values))


def mend(body, rows, twins, at):
    """Return the vertices whose places are those of `at` after mending."""
    found = mended(reading(body, rows, at), lambda: reading(body, rows, twins[at]), body)
    kept = (found == reading(body, rows, at).rows).all(1).numpy()
    return np.where(kept, at, twins[at])


def test_a_map_that_keeps_orientation_is_left_alone(body, rows, twins):
    def asked():
        raise AssertionError("nobody needs the other side")

    here = reading(body, rows, np.arange(body.n_vertices))
    assert mended(here, asked, body) is here.rows


@pytest.mark.parametrize("arms", [(1,), (1, -1)])
def test_exchanged_arms_are_put_on_their_own_side(body, rows, twins, arms):
    at = np.arange(body.n_vertices)
    for side in arms:
        arm = side * body.vertices[:, 0] > 1.0
        assert vertex_areas(body)[arm].sum() > 2 * LEAST * body.area
        at = np.where(arm, twins, at)
    found = mend(body, rows, twins, at)
    wrong = found != np.arange(body.n_vertices)
    assert vertex_areas(body)[wrong].sum() < 0.01 * body.area


def test_a_body_that_is_mirrored_as_a_whole_is_turned_back(body, rows, twins):
    np.testing.assert_array_equal(mend(body, rows, twins, twins), np.arange(body.n_vertices))


def test_nothing_is_mended_where_faces_look_inwards(body, rows, twins):
    inwards = Mesh(body.vertices, body.faces[:, ::-1], "inwards")
    assert body.signed_volume > 0 > inwards.signed_volume
    np.testing.assert_array_equal(mend(inwards, rows, twins, twins), twins)


def test_a_small_part_is_left_alone(body, rows, twins):
    hand = body.vertices[:, 0] > np.quantile(body.vertices[:, 0], 0.998)
    assert 0 < vertex_areas(body)[hand].sum() < LEAST * body.area
    at = np.where(hand, twins, np.arange(body.n_vertices))
    np.testing.assert_array_equal(mend(body, rows, twins, at), at)


def test_an_arm_that_is_mirrored_in_itself_stays_on_its_side(body, rows, twins):
    """Its faces are turned over, but on the other side it would be torn off."""
    axis = np.array([0.95, 0.3, 0.1]) / np.linalg.norm([0.95, 0.3, 0.1])
    across = np.cross(axis, [0, 0, 1.0])
    across /= np.linalg.norm(across)
    arm = body.vertices @ axis > 1.8
    image = body.vertices - 2 * (body.vertices @ across)[:, None] * across
    at = np.where(arm, cKDTree(body.vertices).query(image)[1], np.arange(body.n_vertices))
    low = rows[:, :12]  # which the two sides of a thin arm are alike in
    np.testing.assert_array_equal(mend(body, low, twins, at), at)
