from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import _field, linefield
from csm.operators._edges import interior_edges, longest_edge_basis
from csm.operators.frames import face_frames
from csm.operators.linefield import CURVATURE_LENGTH, smooth_line_field
from tests.shapes import blob, cylinder, plane, rotation, sphere, torus


def lines(directions: np.ndarray) -> np.ndarray:
    """Sign-free form of directions: u u^T."""
    return directions[:, :, None] * directions[:, None, :]


def ellipsoid(subdivisions: int) -> Mesh:
    mesh = sphere(subdivisions)
    return replace(mesh, vertices=mesh.vertices * np.array([1.0, 0.7, 2.0]))


def greatest(mesh: Mesh, smoothing: float = 0.08) -> np.ndarray:
    return face_frames(mesh, frame="smooth", smoothing=smoothing).v


@pytest.mark.parametrize("smoothing", [0.0, 0.08, 0.5])
def test_greatest_curvature_runs_around_a_cylinder(smoothing):
    mesh = cylinder()
    np.testing.assert_allclose(greatest(mesh, smoothing)[:, 2], 0, atol=1e-9)
    np.testing.assert_allclose(np.abs(smooth_line_field(mesh, smoothing)), 1, atol=1e-9)


def test_greatest_curvature_runs_around_the_tube_of_a_torus():
    mesh = torus(n=80, m=40)
    centre = mesh.corners.mean(axis=1)
    around_axis = np.stack([-centre[:, 1], centre[:, 0], np.zeros(mesh.n_faces)], axis=1)
    around_axis /= np.linalg.norm(around_axis, axis=1, keepdims=True)
    assert np.abs((greatest(mesh) * around_axis).sum(axis=1)).max() < np.sin(np.radians(6))


def test_a_plane_has_no_line():
    np.testing.assert_array_equal(smooth_line_field(plane(), 0.08), 0)


@pytest.mark.parametrize("mesh", [torus(), cylinder(), blob(3)], ids=lambda m: m.name)
def test_rigid_motion_scale_and_numbering_carry_the_lines_along(mesh):
    turn, rng = rotation(3), np.random.default_rng(0)
    new_of_old, faces = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_faces)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = 50 * (mesh.vertices @ turn.T + np.array([3.0, -1.0, 2.0]))
    moved = Mesh(vertices, new_of_old[mesh.faces][faces])
    np.testing.assert_allclose(lines(greatest(moved)), lines(greatest(mesh) @ turn.T)[faces], atol=1e-6)


def test_mirror_image_mirrors_the_lines():
    mesh, flip = blob(3), np.diag([-1.0, 1.0, 1.0])
    mirrored = Mesh(mesh.vertices @ flip, mesh.faces[:, ::-1])
    np.testing.assert_allclose(lines(greatest(mirrored)), lines(greatest(mesh) @ flip), atol=1e-8)


def test_smoothing_does_not_depend_on_the_resolution():
    def change(frame: str) -> float:
        coarse, fine = (face_frames(ellipsoid(level), frame=frame).v for level in (3, 5))
        centres = (ellipsoid(level).corners.mean(axis=1) for level in (3, 5))
        a, b = centres
        nearest = ((a[:, None] - b[None]) ** 2).sum(axis=2).argmin(axis=1)
        return float(np.linalg.norm(lines(coarse) - lines(fine)[nearest], axis=(1, 2)).mean())

    assert change("smooth") < 0.1
    assert change("smooth") < change("line_field")


def test_a_sliver_leaves_the_lines_around_it_alone():
    mesh = ellipsoid(3)
    a, b, c = mesh.faces[100]
    near = mesh.vertices[a] + 1e-5 * (mesh.vertices[b] - mesh.vertices[a])  # splits face 100 and its neighbour over ab
    (other,) = (f for f in np.nonzero((mesh.faces == a).any(1) & (mesh.faces == b).any(1))[0] if f != 100)
    d = (set(mesh.faces[other]) - {a, b}).pop()
    new = mesh.n_vertices
    kept = np.delete(mesh.faces, [100, other], axis=0)
    split = Mesh(
        np.vstack([mesh.vertices, near]),
        np.vstack([kept, [[a, new, c], [new, b, c], [b, new, d], [new, a, d]]]),
    )
    before, after = np.delete(greatest(mesh), [100, other], axis=0), greatest(split)[: len(kept)]
    assert np.linalg.norm(lines(after) - lines(before), axis=(1, 2)).max() < 0.01


def test_both_steps_minimise_their_energy():
    """Against least squares over 3-vectors' angles: each face's measure by a loop, each edge by unfolding."""
    mesh, smoothing = ellipsoid(1), 0.2
    area = np.linalg.norm(mesh.face_crosses, axis=1) / 2
    basis, edges = longest_edge_basis(mesh), interior_edges(mesh)

    def line(face: int, edge: int) -> complex:
        t = edges.tangent[edge]
        return complex(t @ basis.e1[face], t @ basis.e2[face]) ** 2

    matrix = np.zeros((mesh.n_faces, mesh.n_faces), dtype=complex)
    measure = np.zeros(mesh.n_faces, dtype=complex)
    for e, (i, j) in enumerate(zip(edges.left, edges.right, strict=True)):
        row = np.zeros(mesh.n_faces, dtype=complex)
        row[i], row[j] = 1, -line(i, e) * np.conj(line(j, e))
        matrix += 3 * edges.length[e] ** 2 / (area[i] + area[j]) * np.outer(row.conj(), row)
        for face in (i, j):
            measure[face] += edges.angle[e] * edges.length[e] / 2 * line(face, e)
    density = np.linalg.solve(np.diag(area) + CURVATURE_LENGTH**2 * area.sum() * matrix, measure)
    target = area * -density / np.abs(density)
    expected = np.linalg.solve(np.diag(area) + smoothing**2 * area.sum() * matrix, target)
    np.testing.assert_allclose(smooth_line_field(mesh, smoothing), expected, atol=1e-9)


def test_negative_length_is_refused():
    with pytest.raises(ConfigError, match="wanted"):
        smooth_line_field(sphere(1), -0.1)


@pytest.fixture
def all_are_big(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linefield, "_FACTORED", 0)


@pytest.mark.usefixtures("all_are_big")
@pytest.mark.parametrize("smoothing", [0.0, 0.02, 0.08])
@pytest.mark.parametrize(
    "mesh",
    [blob(4), torus(), cylinder(), plane(), Mesh(np.eye(3), np.array([[0, 1, 2]]), "face")],
    ids=lambda m: m.name,
)
def test_without_a_factorisation_it_is_the_same(monkeypatch: pytest.MonkeyPatch, mesh: Mesh, smoothing: float):
    found = smooth_line_field(mesh, smoothing)
    monkeypatch.setattr(linefield, "_FACTORED", 10**9)
    np.testing.assert_allclose(found, smooth_line_field(mesh, smoothing), atol=1e-8)


@pytest.mark.usefixtures("all_are_big")
def test_it_is_factored_after_all_where_the_iteration_does_not_end(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_field, "_STEPS", 1)
    found = smooth_line_field(blob(4), 0.08)
    monkeypatch.setattr(linefield, "_FACTORED", 10**9)
    np.testing.assert_array_equal(found, smooth_line_field(blob(4), 0.08))
