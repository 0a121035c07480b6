from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from csm.mesh.shape import Mesh
from csm.operators import polar
from csm.operators.geodesic import geodesics
from csm.operators.polar import PolarDiscs, line_of_sight, polar_discs
from tests.shapes import blob, plane, rotation, sphere


def centres(discs: PolarDiscs) -> np.ndarray:
    return np.repeat(np.arange(len(discs.indptr) - 1), np.diff(discs.indptr))


def turns(discs: PolarDiscs, azimuths: np.ndarray) -> np.ndarray:
    """Spread of the difference between two kinds of angles, per centre, in radians."""
    turn = np.exp(1j * (azimuths - discs.angles))
    of_disc = [turn[a:b] for a, b in itertools.pairwise(discs.indptr)]
    return np.array([np.abs(np.angle(each / each.mean())).max() for each in of_disc])


def test_a_plane_has_plane_polar_coordinates():
    mesh = plane(12)
    discs = polar_discs(mesh, 0.35)
    step = mesh.vertices[discs.vertices] - mesh.vertices[centres(discs)]
    np.testing.assert_allclose(discs.radii, np.linalg.norm(step, axis=1), rtol=2e-6)
    assert turns(discs, np.arctan2(step[:, 1], step[:, 0])).max() < 2e-3  # a gain below 1e-6 of a length is not taken
    distances = np.linalg.norm(mesh.vertices[:, None] - mesh.vertices, axis=2)
    within = {(int(a), int(b)) for a, b in np.argwhere((distances > 0) & (distances < 0.35 - 1e-6))}
    assert within <= set(zip(centres(discs).tolist(), discs.vertices.tolist(), strict=True))


def test_a_sphere_has_meridians():
    mesh = sphere(3)
    discs = polar_discs(mesh, 0.6)
    x, y = mesh.vertices[centres(discs)], mesh.vertices[discs.vertices]
    np.testing.assert_allclose(discs.radii, np.arccos(np.clip((x * y).sum(axis=1), -1, 1)), rtol=0.01)
    first = np.cross(x, np.array([0.3, 0.5, 0.8]))
    second = np.cross(x, first)
    scale = np.linalg.norm(first, axis=1) / np.linalg.norm(second, axis=1)
    assert turns(discs, np.arctan2((y * second).sum(axis=1) * scale, (y * first).sum(axis=1))).max() < 0.05


def test_radii_are_nearly_exact_distances_on_a_curved_shape():
    mesh = blob(2).unit_area()
    discs = polar_discs(mesh, 0.25)
    drawn = np.random.default_rng(0).permutation(len(discs.vertices))[:400]
    exact = geodesics(mesh, "exact").pairs(centres(discs)[drawn], discs.vertices[drawn])
    ratio = discs.radii[drawn] / exact
    assert np.abs(ratio - 1).max() < 0.05
    assert np.abs(ratio - 1).mean() < 1e-3


def test_within_a_short_limit_there_are_the_neighbours():
    mesh = blob(1)
    discs = polar_discs(mesh, 1e-3)
    for i in range(mesh.n_vertices):
        around = set(mesh.faces[(mesh.faces == i).any(axis=1)].ravel().tolist()) - {i}
        assert set(discs.vertices[discs.indptr[i] : discs.indptr[i + 1]].tolist()) == around
    assert (discs.angles >= 0).all()
    assert (discs.angles < 2 * np.pi).all()


def test_a_rigid_motion_and_a_new_numbering_change_nothing():
    mesh = blob(2)
    before = polar_discs(mesh, 0.5)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    points = np.empty_like(mesh.vertices)
    points[new_of_old] = mesh.vertices @ rotation(2).T + 1.0
    after = polar_discs(replace(mesh, vertices=points, faces=new_of_old[mesh.faces]), 0.5)
    a = np.lexsort((new_of_old[before.vertices], new_of_old[centres(before)]))
    np.testing.assert_array_equal(new_of_old[before.vertices][a], after.vertices)
    np.testing.assert_allclose(before.radii[a], after.radii, rtol=1e-5)
    np.testing.assert_allclose(np.exp(1j * before.angles[a]), np.exp(1j * after.angles), atol=5e-3)


def test_blocks_do_not_show(monkeypatch):
    whole = polar_discs(blob(1), 0.8)
    monkeypatch.setattr(polar, "_BLOCK", 5)
    for a, b in zip(polar_discs(blob(1), 0.8), whole, strict=True):
        np.testing.assert_array_equal(a, b)


def test_coordinates_stay_on_their_component():
    one = blob(1)
    twins = Mesh(np.concatenate([one.vertices, one.vertices + 0.1]), np.concatenate([one.faces, one.faces + 42]))
    discs = polar_discs(twins, 0.8)
    np.testing.assert_array_equal(centres(discs) < 42, discs.vertices < 42)


@pytest.mark.parametrize(("x", "inside"), [(0.5, True), (-2.0, False), (3.5, False)])
def test_a_corner_is_seen_through_the_edge_or_not(x, inside):
    eye, third = np.array([0.4, 1.0]), np.array([x, -0.8])
    r, other = np.linalg.norm(eye), np.linalg.norm(eye - [1, 0])
    span, step = np.array([[1.0, 0, 0]]), np.array([[*third, 0]])
    seen = line_of_sight(np.array([r]), np.array([other]), span, step)
    np.testing.assert_allclose(seen.radii, np.linalg.norm(eye - third))

    def bearing(p: np.ndarray) -> float:
        return float(np.arctan2(*(p - eye)[::-1]))

    share = (bearing(third) - bearing(np.zeros(2))) / (bearing(np.array([1.0, 0])) - bearing(np.zeros(2)))
    np.testing.assert_allclose(seen.share, share if inside else -1)
