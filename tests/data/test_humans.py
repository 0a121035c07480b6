"""The built-in humans: what their card promises, the loader, the sets and the data module."""

from __future__ import annotations

import numpy as np
import pytest

from csm.data.humans import SPLITS, HumansDataModule, HumansSet, humans_set, load_humans
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import ConfigError, DataError
from csm.mesh.check import check
from csm.mesh.remesh.edge_moves import edge_table

HUMANS = load_humans()
NAME = "s03_p04"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(tmp_path_factory.mktemp("store"))


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
    flip = HUMANS.mirror().indices
    np.testing.assert_array_equal(flip[flip], np.arange(HUMANS.n_vertices))
    assert (flip != np.arange(HUMANS.n_vertices)).mean() > 0.95

    def rows(faces: np.ndarray) -> np.ndarray:
        turned = np.take_along_axis(faces, (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3, axis=1)
        return turned[np.lexsort(turned.T)]

    np.testing.assert_array_equal(rows(flip[HUMANS.faces][:, ::-1]), rows(HUMANS.faces))


def test_the_mirror_exchanges_left_and_right_of_a_standing_person() -> None:
    x = HUMANS[0].vertices
    reflected = x[HUMANS.mirror().indices] * [-1, 1, 1]
    limb = np.abs(x[:, 0]) > 0.15
    assert (np.sign(x[HUMANS.mirror().indices][limb, 0]) == -np.sign(x[limb, 0])).all()
    assert np.median(np.linalg.norm(reflected - x, axis=1)) < 0.1


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(DataError, match="no 's10_p00'"):
        HUMANS.mesh("s10_p00")
    with pytest.raises(IndexError):
        HUMANS[100]


def test_the_original_is_its_own_truth() -> None:
    shape = humans_set("original").load(NAME)
    np.testing.assert_array_equal(shape.truth.indices, np.arange(shape.mesh.n_vertices))


def test_refined_keeps_the_original_vertices_first(store: str) -> None:
    original = HumansSet().load(NAME).mesh
    refined = humans_set(f"refined_{original.n_vertices + 300}", store).load(NAME)
    assert refined.mesh.n_vertices == original.n_vertices + 300
    np.testing.assert_allclose(refined.mesh.vertices[refined.truth.indices], original.vertices)


def test_remeshed_has_other_vertices_close_to_those_they_stand_for(store: str) -> None:
    original = HumansSet().load(NAME).mesh
    other = humans_set("remeshed_2000", store).load(NAME)
    assert other.mesh.n_vertices == pytest.approx(2000, rel=0.02)
    off = np.linalg.norm(other.mesh.vertices[other.truth.indices] - original.vertices, axis=1)
    edge = np.sqrt(other.mesh.area / other.mesh.n_faces) * 1.5
    assert np.median(off) < edge / 2
    assert 0 < off.max() < 3 * edge


def test_the_mirror_is_the_truth_after_the_flip_of_the_template(store: str) -> None:
    flip = HumansSet().load(NAME).mirror.indices
    other = humans_set("remeshed_2000", store).load(NAME)
    np.testing.assert_array_equal(other.mirror.indices, other.truth.indices[flip])


def test_a_variant_is_computed_once(store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = humans_set("remeshed_2000", store)
    first = wanted.load(NAME)
    monkeypatch.setattr("csm.data.variants.remesh", None)
    assert wanted.load(NAME).mesh.digest == first.mesh.digest


@pytest.mark.parametrize("text", ["", "originals", "original_5", "refined", "refined_many", "remeshed_-3"])
def test_other_names_are_refused(text: str) -> None:
    with pytest.raises(
        ConfigError, match="wanted original, refined_N, remeshed_N or uneven_N with N vertices, slivers_P"
    ):
        humans_set(text)


def test_refined_and_remeshed_humans_are_tested_on(store: str) -> None:
    split = Split("two", ("s00_p00",), (NAME,))
    data = HumansDataModule(
        "original", ("original", "remeshed_2000"), split, descriptor=HKS(k=6, n_times=3), store=Store(store), workers=0
    )
    assert list(data.test_sets) == ["humans", "humans_remeshed_2000"]
    other = data.test_sets["humans_remeshed_2000"]
    assert data.test_names(other) == (NAME,)
    assert data.n_classes == other.load(NAME).truth.n_from == HUMANS.n_vertices
    assert other.store_root == store


def test_splits_are_by_person_and_name_existing_shapes() -> None:
    for split in SPLITS:
        people = [{name[:3] for name in names} for names in (split.train, split.test)]
        assert people[0].isdisjoint(people[1])
        assert {*split.train, *split.test} <= set(HUMANS.names)
    default = HumansDataModule(descriptor=HKS())
    assert default.split is SPLITS[0]
    assert list(default.test_sets) == ["humans", "humans_refined_10000", "humans_refined_15000", "humans_remeshed_5000"]
    demo = HumansDataModule(split="humans_demo", descriptor=HKS())
    assert demo.split is SPLITS[1]
    assert demo.validates_unseen
    people = [{name[:3] for name in names} for names in (demo.fit_names, demo.validation_names, demo.split.test)]
    assert people == [{"s00", "s02", "s04", "s06"}, {"s05", "s07"}, {"s08", "s09"}]
