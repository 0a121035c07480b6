"""The built-in humans: what the card promises, and the loader."""

from __future__ import annotations

import numpy as np
import pytest

from csm.data.humans import load_humans, mirror
from csm.errors import DataError
from csm.mesh.check import check
from csm.mesh.remesh.edge_moves import edge_table

HUMANS = load_humans()


def test_there_are_ten_people_in_ten_poses() -> None:
    assert len(HUMANS) == 100
    assert len(HUMANS.subjects) == len(HUMANS.poses) == 10
    assert (HUMANS.names[0], HUMANS.names[37], HUMANS.names[-1]) == ("s00_p00", "s03_p07", "s09_p09")
    assert HUMANS.mesh("s03_p07").digest == HUMANS[37].digest == HUMANS[-63].digest
    assert [m.name for m in HUMANS[3:6]] == ["s00_p03", "s00_p04", "s00_p05"]
    assert len({m.digest for m in HUMANS}) == 100


def test_the_connectivity_is_one_closed_sphere() -> None:
    mesh = HUMANS[0]
    assert 6800 <= mesh.n_vertices == HUMANS.n_vertices <= 7000
    assert mesh.n_vertices - len(edge_table(mesh.faces).ends) + mesh.n_faces == 2
    assert check(mesh) == ()


@pytest.mark.parametrize("number", [0, 23, 58, 99])
def test_shapes_are_sound_people_of_human_size(number: int) -> None:
    mesh = HUMANS[number]
    assert {f.kind for f in check(mesh)} == set()
    assert 1.2 < mesh.area < 2.6  # m^2, skin of a small and of a large person
    standing = HUMANS[number - number % 10]
    assert 1.5 < np.ptp(standing.vertices[:, 2]) < 2.0
    assert mesh.vertices[:, 2].min() == pytest.approx(0, abs=1e-3)
    squares = ((np.roll(mesh.corners, -1, axis=1) - mesh.corners) ** 2).sum(axis=(1, 2))
    assert np.quantile(4 * np.sqrt(3) * mesh.face_areas / squares, 0.01) > 0.2


def test_coordinates_are_far_finer_than_edges() -> None:
    ends = edge_table(HUMANS.faces).ends
    mean_edge = np.linalg.norm(HUMANS[0].vertices[ends[:, 0]] - HUMANS[0].vertices[ends[:, 1]], axis=1).mean()
    assert HUMANS.arrays["step"].max() < 0.003 * mean_edge


def test_the_mirror_is_an_exact_symmetry_of_the_connectivity() -> None:
    flip = mirror().indices
    np.testing.assert_array_equal(flip[flip], np.arange(HUMANS.n_vertices))
    assert (flip != np.arange(HUMANS.n_vertices)).mean() > 0.95

    def rows(faces: np.ndarray) -> np.ndarray:
        turned = np.take_along_axis(faces, (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3, axis=1)
        return turned[np.lexsort(turned.T)]

    np.testing.assert_array_equal(rows(flip[HUMANS.faces][:, ::-1]), rows(HUMANS.faces))


def test_the_mirror_exchanges_left_and_right_of_a_standing_person() -> None:
    x = HUMANS[0].vertices
    reflected = x[mirror().indices] * [-1, 1, 1]
    limb = np.abs(x[:, 0]) > 0.15
    assert (np.sign(x[mirror().indices][limb, 0]) == -np.sign(x[limb, 0])).all()
    assert np.median(np.linalg.norm(reflected - x, axis=1)) < 0.1


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(DataError, match="no 's10_p00'"):
        HUMANS.mesh("s10_p00")
    with pytest.raises(IndexError):
        HUMANS[100]
