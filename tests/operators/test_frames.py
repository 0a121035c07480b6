from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators.frames import edge_tensors, face_frames, smooth
from tests.shapes import blob, cylinder, plane, rotation, sphere, torus

SHAPES = [sphere(2), torus(), cylinder(), plane(), blob(2)]


def normals(mesh: Mesh) -> np.ndarray:
    return mesh.face_crosses / np.linalg.norm(mesh.face_crosses, axis=1, keepdims=True)


def lines(directions: np.ndarray) -> np.ndarray:
    """Sign-free form of directions: u u^T."""
    return directions[:, :, None] * directions[:, None, :]


@pytest.mark.parametrize("frame", ["line_field", "smooth", "released"])
@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_frames_are_right_handed_and_orthonormal(mesh, frame):
    frames = face_frames(mesh, frame=frame)
    triad = np.stack([frames.u, frames.v, normals(mesh)], axis=1)
    np.testing.assert_allclose(triad @ triad.swapaxes(1, 2), np.broadcast_to(np.eye(3), triad.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(triad), 1, atol=1e-12)
    assert (frames.coherence >= 0).all()
    assert (frames.coherence <= 1 + 1e-12).all()


@pytest.mark.parametrize("sweeps", [0, 3, 10])
def test_least_curvature_runs_along_a_cylinder(sweeps):
    frames = face_frames(cylinder(), sweeps=sweeps)
    np.testing.assert_allclose(np.abs(frames.u[:, 2]), 1, atol=1e-9)
    np.testing.assert_allclose(frames.v[:, 2], 0, atol=1e-9)
    np.testing.assert_allclose(frames.coherence, 1, atol=1e-9)


def test_curvature_is_signed_so_inside_out_exchanges_the_pair():
    mesh = cylinder()
    frames = face_frames(replace(mesh, faces=mesh.faces[:, ::-1]))
    np.testing.assert_allclose(np.abs(frames.v[:, 2]), 1, atol=1e-9)


def test_greatest_curvature_runs_around_the_tube_of_a_torus():
    mesh = torus(n=80, m=40)
    centre = mesh.corners.mean(axis=1)
    around_axis = np.stack([-centre[:, 1], centre[:, 0], np.zeros(mesh.n_faces)], axis=1)
    around_axis /= np.linalg.norm(around_axis, axis=1, keepdims=True)
    along = np.abs((face_frames(mesh).u * around_axis).sum(axis=1))
    assert along.min() > np.cos(np.radians(5))


def test_a_plane_has_no_direction_and_follows_its_longest_edges():
    mesh = plane()
    frames = face_frames(mesh)
    assert (frames.coherence == 0).all()
    edges = mesh.corners[:, [1, 2, 0]] - mesh.corners
    lengths = np.linalg.norm(edges, axis=2)
    longest = edges[np.arange(mesh.n_faces), lengths.argmax(axis=1)] / lengths.max(axis=1, keepdims=True)
    np.testing.assert_allclose(lines(frames.v), lines(longest), atol=1e-12)


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
def test_rigid_motion_and_scale_carry_the_lines_along(mesh, size):
    turn = rotation(3)
    moved = replace(mesh, vertices=size * (mesh.vertices @ turn.T + np.array([3.0, -1.0, 2.0])))
    before, after = face_frames(mesh), face_frames(moved)
    if mesh.name == "sphere":  # symmetric vertices decide by rounding; where a direction exists it must move along
        clear = (before.coherence > 1e-3) & (after.coherence > 1e-3)
        assert clear.mean() > 0.5
    else:
        clear = np.ones(mesh.n_faces, dtype=bool)
    np.testing.assert_allclose(lines(after.v)[clear], lines(before.v @ turn.T)[clear], atol=1e-6)
    np.testing.assert_allclose(lines(after.u)[clear], lines(before.u @ turn.T)[clear], atol=1e-6)


@pytest.mark.parametrize("mesh", [blob(2), plane(), torus()], ids=lambda m: m.name)
def test_numbering_of_vertices_and_faces_plays_no_part(mesh):
    rng = np.random.default_rng(0)
    new_of_old, faces = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_faces)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    after = face_frames(Mesh(vertices, new_of_old[mesh.faces][faces]))
    np.testing.assert_allclose(lines(after.v), lines(face_frames(mesh).v)[faces], atol=1e-9)


def test_mirror_image_mirrors_the_lines():
    mesh = blob(3)
    flip = np.diag([-1.0, 1.0, 1.0])
    mirrored = Mesh(mesh.vertices @ flip, mesh.faces[:, ::-1])
    np.testing.assert_allclose(lines(face_frames(mirrored).v), lines(face_frames(mesh).v @ flip), atol=1e-9)


def test_released_frame_depends_on_the_world_axes_and_line_field_does_not():
    mesh, turn = blob(3), rotation(1)
    moved = replace(mesh, vertices=mesh.vertices @ turn.T)
    change = {
        frame: np.abs(lines(face_frames(moved, frame=frame).v) - lines(face_frames(mesh, frame=frame).v @ turn.T)).max()
        for frame in ("released", "line_field")
    }
    assert change["released"] > 0.1
    assert change["line_field"] < 1e-9


def test_edge_tensors_against_a_loop_over_edges():
    mesh = cylinder(n=7, m=4)  # with a boundary
    n = normals(mesh)
    sides = {}
    for f, face in enumerate(mesh.faces):
        for a, b in zip(face, np.roll(face, -1), strict=True):
            sides[a, b] = f
    inner = [(a, b) for a, b in sides if a < b and (b, a) in sides]
    mean_length = np.mean([np.linalg.norm(mesh.vertices[b] - mesh.vertices[a]) for a, b in inner])
    total, count = np.zeros((mesh.n_vertices, 3, 3)), np.zeros(mesh.n_vertices)
    for a, b in inner:
        edge = mesh.vertices[b] - mesh.vertices[a]
        length = np.linalg.norm(edge)
        n1, n2 = n[sides[a, b]], n[sides[b, a]]
        angle = np.arccos(np.clip(n1 @ n2, -1, 1)) * np.sign(np.cross(n1, n2) @ edge)
        for vertex in (a, b):
            total[vertex] += length / mean_length * angle * np.outer(edge, edge) / length**2
            count[vertex] += 1
    np.testing.assert_allclose(edge_tensors(mesh), total / count[:, None, None], atol=1e-7)


def test_smoothing_against_a_loop_over_neighbours():
    mesh = plane(5)
    tensors = np.random.default_rng(0).normal(size=(mesh.n_vertices, 3, 3))
    ring = [{v} for v in range(mesh.n_vertices)]
    for a, b, c in mesh.faces:
        for v in (a, b, c):
            ring[v] |= {a, b, c}
    expected = tensors
    for _ in range(2):
        expected = np.stack([expected[sorted(r)].mean(axis=0) for r in ring])
    np.testing.assert_allclose(smooth(mesh, tensors, 2), expected, atol=1e-12)
    np.testing.assert_array_equal(smooth(mesh, tensors, 0), tensors)


def test_line_average_is_the_leading_eigenvector_of_the_corner_lines():
    mesh = blob(2)
    tensors = smooth(mesh, edge_tensors(mesh), 3)
    frames = face_frames(mesh, sweeps=3)
    for f in range(0, mesh.n_faces, 37):
        n = normals(mesh)[f]
        flat = np.eye(3) - np.outer(n, n)
        total = np.zeros((3, 3))
        for vertex in mesh.faces[f]:
            values, vectors = np.linalg.eigh(flat @ tensors[vertex] @ flat)
            tangent = np.abs(vectors.T @ n) < 0.5
            line = vectors[:, tangent][:, values[tangent].argmin()]
            total += np.outer(line, line)
        values, vectors = np.linalg.eigh(total)
        np.testing.assert_allclose(
            np.outer(frames.v[f], frames.v[f]), np.outer(vectors[:, 2], vectors[:, 2]), atol=1e-8
        )
        assert frames.coherence[f] == pytest.approx((values[2] - values[1]) / 3, abs=1e-8)


def test_face_without_area_gets_its_longest_edge():
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 1.0]]), np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2]]))
    for frame in ("line_field", "smooth", "released"):
        frames = face_frames(mesh, frame=frame)
        np.testing.assert_allclose(np.abs(frames.v[0]), [1, 0, 0], atol=1e-12)
        np.testing.assert_array_equal(frames.u[0], 0)
        assert np.isfinite(frames.v).all()


@pytest.mark.parametrize("wrong", [{"frame": "curly"}, {"sweeps": -1}, {"frame": "smooth", "smoothing": -0.1}])
def test_unknown_settings_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        face_frames(sphere(1), **wrong)
