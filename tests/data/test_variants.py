from __future__ import annotations

import numpy as np
import pytest

from csm.data.registry import recognise
from csm.data.store import Store
from csm.data.variants import VariantSet, Variation
from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from tests.shapes import blob, sphere
from tests.toyset import write_toys


@pytest.mark.parametrize("text", ["refined_900", "remeshed_300", "uneven_400", "slivers_20"])
def test_each_vertex_of_the_original_has_a_place_and_it_is_computed_once(tmp_path, text):
    mesh, store, variation = blob(3), Store(tmp_path), Variation.parse(text)
    made = variation.of(mesh, store)
    assert made["truth"].shape == (mesh.n_vertices,)
    wanted = 1.2 * mesh.n_vertices if variation.variant == "slivers" else variation.amount
    assert 0.99 < len(made["vertices"]) / wanted < 1.01
    moved = np.linalg.norm(made["vertices"][made["truth"]] - mesh.vertices, axis=1)
    assert moved.max() < 0.4
    before = store.computed
    np.testing.assert_array_equal(variation.of(mesh, store)["faces"], made["faces"])
    assert store.computed == before


def test_uneven_meshes_are_dense_at_one_end_which_differs_between_shapes(tmp_path):
    store, directions = Store(tmp_path), []
    for name in ("a", "b"):
        made = Variation("uneven", 1500).of(Mesh(sphere(4).vertices, sphere(4).faces, name), store)
        mesh = Mesh(made["vertices"], made["faces"], name)
        middles = mesh.corners.mean(axis=1)
        slope, *_ = np.linalg.lstsq(np.c_[middles, np.ones(mesh.n_faces)], np.log(mesh.face_areas), rcond=None)
        directions.append(slope[:3] / np.linalg.norm(slope[:3]))
        height = middles @ directions[-1]
        assert mesh.face_areas[height > 0.7].mean() > 5 * mesh.face_areas[height < -0.7].mean()
    assert abs(directions[0] @ directions[1]) < 0.99


def test_a_cut_takes_its_share_of_the_area_and_says_what_is_gone(tmp_path):
    mesh, store = sphere(4), Store(tmp_path)
    made = Variation("cut", 30).of(mesh, store)
    left = Mesh(made["vertices"], made["faces"], "left")
    assert left.area / mesh.area == pytest.approx(0.7, abs=0.01)
    stays = made["truth"] >= 0
    np.testing.assert_array_equal(mesh.vertices[stays], left.vertices[made["truth"][stays]])


def test_shapes_of_other_names_lose_other_parts(tmp_path):
    store = Store(tmp_path)
    first, again, other = (
        Variation("cut", 30).of(Mesh(sphere(3).vertices, sphere(3).faces, name), store)["truth"] for name in "aab"
    )
    np.testing.assert_array_equal(first, again)
    assert ((first >= 0) != (other >= 0)).any()


def test_a_bridge_keeps_all_vertices_and_adds_a_handle(tmp_path):
    mesh = blob(3)
    made = Variation("bridged", 40).of(mesh, Store(tmp_path))
    np.testing.assert_array_equal(made["truth"], np.arange(mesh.n_vertices))
    assert len(made["faces"]) == mesh.n_faces + 4
    with pytest.raises(MeshError, match=r"no two points are .* apart along the surface"):
        Variation("bridged", 99).of(mesh, Store(tmp_path))


@pytest.mark.parametrize("text", ["cut_0", "cut_100", "bridged_100", "remeshed_0"])
def test_a_number_that_cannot_be_is_refused(text):
    with pytest.raises(ConfigError, match=f"{text}: wanted 1"):
        Variation.parse(text)


@pytest.mark.parametrize("text", ["cut", "cut_x", "bent_3", "", "humans", "cut_-3", "remeshed_5000_2"])
def test_other_words_are_no_variations(text):
    assert Variation.parse(text) is None


@pytest.mark.parametrize("text", ["remeshed_300", "cut_20"])
def test_another_form_keeps_the_places_of_the_template(tmp_path, text):
    toys = recognise(write_toys(tmp_path / "toys"))
    shapes = VariantSet(toys, Variation.parse(text), str(tmp_path))
    before, after = toys.load("toy0"), shapes.load("toy0")
    assert shapes.name == f"{toys.name}_{text}"
    assert after.mesh.n_vertices != before.mesh.n_vertices
    assert after.truth.n_from == before.truth.n_from
    known = after.truth.indices >= 0
    assert known.mean() > 0.5
    moved = np.linalg.norm(
        after.mesh.vertices[after.truth.indices[known]] - before.mesh.vertices[before.truth.indices[known]], axis=1
    )
    assert moved.max() < 0.2 * np.ptp(before.mesh.vertices, axis=0).max()
