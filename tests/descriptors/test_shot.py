from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import shot
from csm.descriptors.shot import SHOT
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, mirrored
from tests.shapes import blob, plane

SMALL = SHOT(radius=0.25, bins=5)


def normals_by_loops(mesh: Mesh) -> np.ndarray:
    total = np.zeros((mesh.n_vertices, 3))
    for a, b, c in mesh.faces:
        p, q, r = mesh.vertices[[a, b, c]]
        for vertex in (a, b, c):
            total[vertex] += np.cross(q - p, r - p)
    return total / np.linalg.norm(total, axis=1)[:, None]


def frame_by_loops(offsets: list[np.ndarray], weights: list[float], radius: float) -> tuple[np.ndarray, ...]:
    covariance, total = np.zeros((3, 3)), 0.0
    for offset, weight in zip(offsets, weights, strict=True):
        pull = weight * (radius - np.linalg.norm(offset))
        covariance += pull * np.outer(offset, offset)
        total += pull
    vectors = np.linalg.eigh(covariance / total)[1]
    axes = []
    for axis in (vectors[:, 2], vectors[:, 0]):
        ahead = sum(w for o, w in zip(offsets, weights, strict=True) if o @ axis >= 0)
        behind = sum(w for o, w in zip(offsets, weights, strict=True) if o @ axis < 0)
        mean = sum(w * (o @ axis) for o, w in zip(offsets, weights, strict=True))
        axes.append(axis if ahead > behind or (ahead == behind and mean >= 0) else -axis)
    return axes[0], np.cross(axes[1], axes[0]), axes[1]


def vote(row: np.ndarray, local: np.ndarray, cosine: float, radius: float) -> None:
    """Add one neighbour to a histogram row of shape (8 azimuths, 2 rings, 2 sides, bins + 1), case by case."""
    bins, distance = row.shape[3] - 1, np.linalg.norm(local)
    degrees = np.degrees(np.arctan2(local[1], local[0]))
    sector = next(s for s in range(8) if degrees <= -180 + 45 * (s + 1))
    ring, side = int(distance > radius / 2), int(local[2] > 0)
    along = (1 + cosine) * bins / 2
    step = int(np.floor(along + 0.5))
    own = 1 - abs(along - step)
    if along > step:
        row[sector, ring, side, step + 1] += along - step
    elif along < step:
        row[sector, ring, side, step - 1] += step - along
    gap = abs(distance - (0.75 if ring else 0.25) * radius) / (radius / 2)
    own += 1 - gap
    if 0.25 * radius < distance < 0.75 * radius:
        row[sector, 1 - ring, side, step] += gap
    inclination = np.degrees(np.arccos(local[2] / distance))
    gap = abs(inclination - (45 if side else 135)) / 90
    own += 1 - gap
    if 45 < inclination < 135:
        row[sector, ring, 1 - side, step] += gap
    off = (degrees - (-157.5 + 45 * sector)) / 45
    own += 1 - abs(off)
    row[(sector + (1 if off > 0 else -1)) % 8, ring, side, step] += abs(off)
    row[sector, ring, side, step] += own


def by_loops(mesh: Mesh, descriptor: SHOT, areas: np.ndarray) -> np.ndarray:
    normals, radius = normals_by_loops(mesh), descriptor.radius * np.sqrt(mesh.area)
    values = np.zeros((mesh.n_vertices, 8, 2, 2, descriptor.bins + 1))
    for p, row in enumerate(values):
        offsets = mesh.vertices - mesh.vertices[p]
        distance = np.linalg.norm(offsets, axis=1)
        near = [q for q in range(mesh.n_vertices) if q != p and distance[q] <= radius]
        if len(near) < descriptor.min_neighbours:
            continue
        x, y, z = frame_by_loops([offsets[q] for q in near], [areas[q] for q in near], radius)
        for q in near:
            single = np.zeros_like(row)
            vote(single, np.array([offsets[q] @ x, offsets[q] @ y, offsets[q] @ z]), normals[q] @ z, radius)
            row += areas[q] * single
        row /= np.sqrt((row**2).sum())
    return values.reshape(mesh.n_vertices, -1)


@pytest.mark.parametrize("area_weighted", [False, True])
@pytest.mark.parametrize("bins", [1, 10])
def test_against_loops(bins, area_weighted):
    descriptor = SHOT(radius=0.25, bins=bins, area_weighted=area_weighted)
    operators = Operators(blob(2))
    areas = operators.mass if area_weighted else np.ones(operators.mesh.n_vertices)
    expected = by_loops(operators.mesh, descriptor, areas)
    np.testing.assert_allclose(descriptor(operators).values, expected, atol=1e-9)


def test_blocks_do_not_show(monkeypatch):
    whole = SMALL(blob(2)).values
    monkeypatch.setattr(shot, "PAIRS_AT_ONCE", 100)
    np.testing.assert_allclose(SMALL(blob(2)).values, whole, atol=1e-12)


def test_rows_have_unit_length_and_no_negative_entry():
    values = SMALL(blob(3)).values
    np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1)
    assert values.min() >= 0


def test_too_few_neighbours_give_zeros():
    counts = [
        np.count_nonzero(np.linalg.norm(blob(2).vertices - p, axis=1) <= 0.08 * np.sqrt(blob(2).area)) - 1
        for p in blob(2).vertices
    ]
    assert min(counts) < 5 <= max(counts)
    values = SHOT(radius=0.08)(blob(2)).values
    np.testing.assert_array_equal((values == 0).all(axis=1), np.array(counts) < 5)
    assert not SHOT(radius=1e-3)(blob(2)).values.any()


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("area_weighted", [False, True])
def test_invariance(area_weighted, check):
    check(SHOT(radius=0.25, bins=5, area_weighted=area_weighted))


def test_the_radius_is_relative_at_any_scale():
    before = SMALL(blob(3)).values
    np.testing.assert_allclose(SMALL(Operators(blob(3), unit_area=False)).values, before, atol=1e-9)


def test_a_mirror_reverses_the_azimuth_sectors():
    before, after = (SMALL(mesh).values.reshape(mesh.n_vertices, 8, -1) for mesh in (blob(3), mirrored(blob(3))))
    np.testing.assert_allclose(after, before[:, ::-1], atol=1e-9)
    assert np.abs(after - before).max() > 0.1


def test_a_plane_fills_only_the_last_cosine():
    values = np.abs(SHOT(radius=0.2, bins=4)(plane()).values.reshape(-1, 32, 5))
    at_an_end = values[:, :, 0].sum(axis=1) + values[:, :, 4].sum(axis=1)
    np.testing.assert_allclose(values.sum(axis=(1, 2)), at_an_end)


def test_columns_say_where_they_are():
    descriptor = SHOT(bins=4)
    assert len(set(descriptor.columns)) == 160
    assert descriptor.columns[-1] == "azimuth=157.5 outer above cos=1"


@pytest.mark.parametrize("wrong", [{"radius": 0.0}, {"bins": 0}, {"min_neighbours": 0}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        SHOT(**wrong)
