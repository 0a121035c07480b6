from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from csm.descriptors import lps
from csm.descriptors.lps import LPS, frequencies, submesh
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.descriptors.test_dep import edge_distances
from tests.shapes import blob, plane, rotation, sphere

SMALL = LPS(radii=(0.3, 0.22), k=5)


def cotangent_pencil(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Dense stiffness and mass by loops over corners."""
    stiff, mass = np.zeros((len(vertices), len(vertices))), np.zeros(len(vertices))
    for face in faces:
        for turn in range(3):
            a, b, c = np.roll(face, turn)
            u, v = vertices[b] - vertices[a], vertices[c] - vertices[a]
            twice = np.linalg.norm(np.cross(u, v))
            half = u @ v / twice / 2
            for i, j in ((b, c), (c, b)):
                stiff[i, j] -= half
                stiff[i, i] += half
            mass[a] += twice / 6
    return stiff, np.diag(mass)


def by_loops(mesh: Mesh, descriptor: LPS) -> np.ndarray:
    distances = edge_distances(mesh)
    rows = []
    for row in distances:
        values = []
        for radius in descriptor.radii:
            near = {v for v in range(mesh.n_vertices) if row[v] <= radius * distances.max()}
            faces = [face for face in mesh.faces if set(face.tolist()) <= near]
            kept = sorted({int(v) for face in faces for v in face})
            place = {v: i for i, v in enumerate(kept)}
            local = np.array([[place[int(v)] for v in face] for face in faces])
            points = mesh.vertices[kept]
            stiff, mass = cotangent_pencil(points, local)
            evals, evecs = scipy.linalg.eigh(stiff, mass)
            for i in range(1, descriptor.k + 1):
                moment = sum(mass[v, v] * evecs[v, i] * points[v] for v in range(len(kept)))
                values.append(evals[i] * np.linalg.norm(moment))
        rows.append(values)
    return np.array(rows)


def test_against_loops_over_vertices_discs_and_corners():
    mesh = blob(2).unit_area()
    expected = by_loops(mesh, SMALL)
    np.testing.assert_allclose(SMALL(mesh).values, expected, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(LPS(radii=(0.2,), k=4))


def test_a_mirror_image_has_the_same_rows():
    assert_close(SMALL(mirrored(blob(2))).values, SMALL(blob(2)).values)


def test_blocks_do_not_show(monkeypatch):
    whole = SMALL(blob(2)).values
    monkeypatch.setattr(lps, "_BLOCK", 7)
    np.testing.assert_array_equal(SMALL(blob(2)).values, whole)


def test_only_the_disc_counts():
    """A bump changes nothing far away, as long as the diameter, here the diagonal, stays."""
    mesh = plane(15)
    x, y, _ = mesh.vertices.T
    bump = (x > 0.7) & (abs(y - 0.5) < 0.15)
    bumped = replace(mesh, vertices=mesh.vertices + np.outer(bump, [0, 0, 0.1]))
    descriptor = LPS(radii=(0.2,), k=4)
    before, after = (descriptor(Operators(m, unit_area=False)).values for m in (mesh, bumped))
    np.testing.assert_array_equal(after[x < 0.35], before[x < 0.35])
    assert np.abs(after - before)[bump].max() > 0.1 * np.abs(before).max()


def test_small_and_large_discs_are_solved_alike(monkeypatch):
    disc = plane(12)
    small = frequencies(disc, 6)
    monkeypatch.setattr(lps, "_DENSE_BELOW", 0)
    np.testing.assert_allclose(frequencies(disc, 6), small, atol=1e-8 * small.max())


def test_frequencies_have_no_unit_and_do_not_depend_on_the_place_in_space():
    disc = plane(9)
    moved = replace(disc, vertices=7.0 * disc.vertices @ rotation(3).T + 5.0)
    np.testing.assert_allclose(frequencies(moved, 6), frequencies(disc, 6), rtol=1e-6)


def test_a_flat_disc_has_two_frequencies_that_carry_its_shape():
    """x - 1/2 and y - 1/2 of the square are sums of odd cosines, of which the first carry almost all."""
    values = frequencies(plane(25), 6)
    ideal = np.pi**2 * np.sqrt(2) * 2 / np.pi**2  # lambda_1 times the integral of x sqrt(2) cos(pi x)
    np.testing.assert_allclose(values[:2], ideal, rtol=0.02)
    assert values[2:].max() < 0.1 * ideal


def test_what_a_small_disc_does_not_have_is_zero():
    mesh = blob(1)  # 42 vertices: a ring has 5 or 6
    values = LPS(radii=(0.3,), k=16)(mesh).values
    distances = edge_distances(mesh)
    for row, value in zip(distances, values, strict=True):
        inside = row <= 0.3 * distances.max()
        disc = submesh(mesh, mesh.faces[inside[mesh.faces].all(axis=1)])
        n = min(16, max(disc.n_vertices - 1, 0))
        assert not value[n:].any()
        assert (value[:n] > 0).any() == (n > 0)
    assert not LPS(radii=(1e-3,), k=3)(mesh).values.any()


def test_every_vertex_of_a_sphere_has_nearly_the_same_discs():
    values = LPS(radii=(0.3,), k=2)(sphere(3)).values
    assert (values.std(axis=0) < 0.1 * values.mean(axis=0)).all()


@pytest.mark.parametrize("wrong", [{"radii": ()}, {"radii": (0.1, 0.0)}, {"k": 0}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        LPS(**wrong)
