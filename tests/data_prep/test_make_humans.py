"""The steps that make the built-in humans, on spheres: decimation, flips, closed cavities, intersections and poses."""

from __future__ import annotations

import importlib
from collections import Counter

import numpy as np
import pytest
from scipy.spatial import cKDTree

from csm.mesh.intersections import intersecting_pairs
from tests.conftest import ROOT
from tests.shapes import sphere

SHAPES = np.array([[1.0, 1.0, 1.0], [1.0, 0.8, 1.3], [0.7, 1.0, 1.1]])


@pytest.fixture
def load(monkeypatch):
    """Import a module as the script does, whose folder leads the search path."""
    monkeypatch.syspath_prepend(str(ROOT / "data_prep"))
    return importlib.import_module


@pytest.fixture(scope="module")
def ball():
    """A sphere of 642 vertices, its faces, and its mirror map x -> -x."""
    mesh = sphere(3)
    distance, mirror = cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])
    assert distance.max() < 1e-12
    return mesh.vertices, mesh.faces, mirror


def oriented(faces: np.ndarray) -> Counter[tuple[int, ...]]:
    """Return the faces, each from its lowest vertex on."""
    return Counter(tuple(np.roll(face, -face.argmin()).tolist()) for face in np.asarray(faces))


def assert_closed_and_symmetric(faces: np.ndarray, mirror: np.ndarray) -> None:
    """A closed oriented surface of genus 0 that is its own mirror image."""
    edges = Counter((int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    assert len(np.unique(faces)) - len(edges) // 2 + len(faces) == 2
    assert oriented(faces) == oriented(mirror[faces][:, ::-1])


def test_the_cost_of_a_collapse_is_the_squared_distance_to_the_planes_and_a_little_length(load, ball):
    decimate = load("humans.decimate")
    vertices, faces, mirror = ball
    shapes = vertices * SHAPES[:, None]
    decimation = decimate.Decimation(shapes, faces, mirror)
    u = 200
    for v in sorted(decimation.neighbours(u)):
        expected = []
        for x in shapes:
            p, q, r = (x[faces[(faces == u).any(1)][:, k]] for k in range(3))
            cross = np.cross(q - p, r - p)
            third = np.linalg.norm(cross, axis=1) / 6
            height = (cross / np.linalg.norm(cross, axis=1, keepdims=True) * (x[v] - p)).sum(1)
            expected.append((third * (height**2 + decimate.TANGENTIAL * ((x[v] - x[u]) ** 2).sum())).sum())
        assert decimation.cost(u, v) == pytest.approx(np.mean(expected))


def test_decimation_keeps_surface_symmetry_and_topology(load, ball):
    decimate = load("humans.decimate")
    vertices, faces, mirror = ball
    decimation = decimate.Decimation(vertices * SHAPES[:, None], faces, mirror)
    decimation.run(250)
    left, found = np.array(sorted(decimation.around)), np.array(list(decimation.faces.values()))
    assert 248 <= len(left) <= 250
    assert set(mirror[left]) == set(left) == set(np.unique(found))
    assert_closed_and_symmetric(found, mirror)
    assert np.bincount(found.ravel()).max() <= decimate.MAX_VALENCE
    assert decimate.quality(vertices[found]).min() > decimate.MIN_QUALITY
    corners = vertices[found]
    outward = (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * corners.mean(1)).sum(1)
    assert outward.min() > 0
    assert np.linalg.norm(corners.mean(1), axis=1).min() > 0.95


def test_quality_is_one_for_equilateral_and_zero_for_flat_triangles(load):
    quality = load("humans.decimate").quality
    equal = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    np.testing.assert_allclose(quality(np.stack([equal, 7 * equal, flat])), [1, 1, 0], atol=1e-12)


def excess(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return by how much the angles opposite to the edges exceed pi, all edges together (radians)."""
    total: Counter[tuple[int, ...]] = Counter()
    for f in faces:
        for k in range(3):
            a, b, c = vertices[np.roll(f, -k)]
            cosine = (b - a) @ (c - a) / np.linalg.norm(b - a) / np.linalg.norm(c - a)
            total[tuple(sorted((int(f[(k + 1) % 3]), int(f[(k + 2) % 3]))))] += np.arccos(cosine)
    return float(sum(max(0.0, value - np.pi) for value in total.values()))


def test_flips_make_a_stretched_ball_more_delaunay_and_leave_a_round_one_alone(load, ball):
    flip = load("humans.edge_flips").flip_towards_delaunay
    vertices, faces, mirror = ball
    assert oriented(flip(vertices[None], faces, mirror)) == oriented(faces)
    long = vertices * [1, 1, 3]
    flipped = flip(long[None], faces, mirror)
    assert_closed_and_symmetric(flipped, mirror)
    assert excess(long, flipped) < 0.5 * excess(long, faces)


def test_cavities_on_the_midline_and_on_both_sides_are_closed(load, ball):
    module = load("humans.close_cavities")
    vertices, faces, mirror = ball
    one_ring = (faces == vertices[:, 2].argmax()).any(1)
    two_rings = np.isin(faces, faces[one_ring]).any(1)
    cavity = two_rings | (np.abs(vertices[faces].mean(1)[:, 0]) > 0.85)
    assert len(module.boundary_loops(faces[cavity])) == 3
    closed = module.close_cavities(vertices, faces, cavity, mirror)
    assert_closed_and_symmetric(closed, mirror)
    assert not oriented(faces[~cavity]) - oriented(closed)


def triangulations(loop: list[int]) -> list[list[tuple[int, int, int]]]:
    """Return every triangulation of a polygon."""
    if len(loop) < 3:
        return [[]]
    return [
        [(loop[0], loop[k], loop[-1]), *left, *right]
        for k in range(1, len(loop) - 1)
        for left in triangulations(loop[: k + 1])
        for right in triangulations(loop[k:])
    ]


def test_a_filling_has_the_least_sum_of_squared_edges(load):
    vertices = np.random.default_rng(0).normal(size=(7, 3))
    loop = [3, 0, 5, 1, 6, 2, 4]

    def cost(triangles: list[tuple[int, int, int]]) -> float:
        diagonals = {tuple(sorted((t[k], t[k - 1]))) for t in triangles for k in range(3)}
        return sum(((vertices[a] - vertices[b]) ** 2).sum() for a, b in diagonals)

    found = load("humans.close_cavities").fill(vertices, loop)
    assert found.shape == (5, 3)
    every = triangulations(loop)
    assert len(every) == 42
    assert cost([tuple(t) for t in found.tolist()]) == pytest.approx(min(map(cost, every)))


def test_triangles_that_cut_through_each_other_are_found_and_come_apart(load, ball):
    intersect = load("humans.intersect")
    vertices, faces, _ = ball
    assert len(intersecting_pairs(vertices, faces)) == 0
    crossed = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.3, 0.2, 1], [0.2, 0.3, 1]])
    two = np.array([[0, 1, 2], [3, 4, 5]])
    assert intersecting_pairs(crossed, two).tolist() == [[0, 1]]
    apart = crossed + np.repeat([[0, 0, 0], [0, 0, 2]], 3, axis=0)
    assert len(intersecting_pairs(apart, two)) == 0
    cap = vertices[:, 2] > 0.9
    tangled = vertices + 0.2 * cap[:, None] * np.random.default_rng(0).normal(size=vertices.shape)
    assert len(intersecting_pairs(tangled, faces)) > 0
    smooth = intersect.untangle(tangled, faces)
    assert len(intersecting_pairs(smooth, faces)) == 0
    np.testing.assert_array_equal(smooth[vertices[:, 2] < 0], vertices[vertices[:, 2] < 0])


def test_the_right_side_of_a_pose_mirrors_the_left_unless_it_is_given(load):
    joints = {pose.name: pose.joints() for pose in load("humans.bodies").POSES}
    assert len(joints) == 10
    assert joints["stand"]["arm.L"] == (0, 58, 0)
    assert joints["stand"]["arm.R"] == (0, -58, 0)
    assert joints["twist"]["arm.R"] == (0, -16, 35)


def test_simplified_shapes_keep_their_positions_and_the_mirror(load, ball):
    script = load("make_humans")
    vertices, faces, mirror = ball
    scale = np.random.default_rng(0).uniform(0.8, 1.2, (len(script.SUBJECTS) * len(script.POSES), 1, 3))
    shapes, found, symmetric, numbers = script.simplify(vertices * scale, faces, mirror, 500)
    assert shapes.shape[1] <= 500
    distance, kept = cKDTree(vertices * scale[0]).query(shapes[0])
    assert distance.max() == 0
    np.testing.assert_array_equal(shapes, (vertices * scale)[:, kept])
    np.testing.assert_array_equal(kept, numbers)
    np.testing.assert_array_equal(kept[symmetric], mirror[kept])
    assert_closed_and_symmetric(found, symmetric)


def test_a_figure_stands_on_the_ground_and_the_file_holds_it_to_a_65535th(load, ball, tmp_path, capsys):
    script = load("make_humans")
    vertices, faces, mirror = ball
    shapes = np.stack([script.standing(vertices * scale + [3.0, 2.0, 1.0]) for scale in SHAPES])
    np.testing.assert_allclose(shapes[:, :, 2].min(1), 0, atol=1e-12)
    np.testing.assert_allclose(shapes.min(1)[:, :2] + shapes.max(1)[:, :2], 0, atol=1e-12)
    script.write(tmp_path / "humans.npz", shapes, faces, mirror, 7)
    assert "3 shapes of 642 vertices" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["humans.npz"]
    with np.load(tmp_path / "humans.npz") as file:
        levels = np.cumsum(file["differences"], axis=1, dtype=np.uint16)
        read = levels * file["step"][:, None, None] + file["offset"][:, None]
        assert np.abs(read - shapes).max() <= 0.51 * file["step"].max()
        np.testing.assert_array_equal(file["faces"], faces)
        np.testing.assert_array_equal(file["mirror"], mirror)
        assert int(file["seed"]) == 7
