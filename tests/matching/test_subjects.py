from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from csm.data.store import Store
from csm.errors import ConfigError, MeshError
from csm.matching import BarycentricMap, VertexMap, Way, match_meshes
from csm.matching.functional import FunctionalMap
from csm.matching.subjects import on_given, on_given_faces, on_given_vertices, subject_of
from csm.mesh.io import read_mesh, write_mesh
from csm.mesh.shape import Mesh
from tests.mesh.test_debris import scattered
from tests.shapes import blob

CASES = Path(__file__).parent.parent / "cases"


@pytest.fixture(scope="module")
def spot() -> Mesh:
    return read_mesh(CASES / "spot_reference.obj")


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> Store:
    return Store(tmp_path_factory.mktemp("store"))


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("spot_inside_out.off", "1654 faces turned: inside out as a whole"),
        ("spot_random_face_orientation.off", "faces turned: against their neighbours"),
        ("spot_split_at_seam.off", "70 vertices welded"),
        ("spot_isolated_vertex.off", "1 vertex in no face left out"),
        ("spot_with_300_debris_triangles.off", "300 pieces of debris left out"),
    ],
)
def test_a_spoilt_mesh_is_matched_like_the_good_one_and_it_is_said(spot, store, case, said):
    match = match_meshes(CASES / case, spot, store=store)
    n = len(match.indices)
    assert n == match.source.n_vertices
    where = np.flatnonzero(match.indices >= 0)
    places = spot.vertices[match.indices[where]]
    np.testing.assert_allclose(places, match.source.vertices[where], atol=1e-9)
    assert len(where) >= spot.n_vertices
    assert any(said in note and case in note for note in match.notes)
    assert match.confidence.returned == 1.0


def test_debris_and_lone_vertices_have_no_match_in_either_direction(spot, store):
    case = CASES / "spot_with_300_debris_triangles.off"
    for cleaning in ("auto", "off"):
        there = match_meshes(case, spot, clean=cleaning, store=store)
        back = match_meshes(spot, case, clean=cleaning, store=store)
        assert (there.indices[829:] == -1).all()
        assert (there.confidence.values[829:] == 0).all()
        assert back.indices.max() < 829
        assert (back.indices == np.arange(829)).all()


def test_without_cleaning_the_findings_are_still_said(spot, store):
    match = match_meshes(CASES / "spot_inside_out.off", spot, clean="off", store=store)
    assert any("all faces are oriented inwards" in note for note in match.notes)
    assert (match.indices == np.arange(829)).mean() < 0.5


def test_a_part_has_a_map_of_low_confidence_and_it_is_said(spot, store):
    match = match_meshes(CASES / "spot_half.off", spot, store=store)
    assert any("is open" in note and "is closed" in note for note in match.notes)
    assert "WARNING" in match.confidence.verdict
    assert match.confidence.values.mean() < 0.4


def test_a_good_mesh_is_said_nothing_of(spot, store):
    assert match_meshes(spot, spot, store=store).notes == ()


def test_a_map_between_cleaned_meshes_becomes_one_between_the_given():
    mesh, kept = scattered(blob(2), 10, 1e-3)
    source, target = subject_of(mesh), subject_of(blob(2))
    found = VertexMap(np.arange(source.cleaned.mesh.n_vertices), 162)
    assert source.cleaned.mesh.n_vertices == 162
    given = on_given_vertices(found, source, target)
    assert given.indices.shape == (mesh.n_vertices,)
    assert np.flatnonzero(given.indices >= 0).tolist() == sorted(kept)


@pytest.mark.parametrize(
    "case",
    [
        "spot_reference.obj",
        "spot_inside_out.off",
        "spot_random_face_orientation.off",
        "spot_split_at_seam.off",
        "spot_with_300_debris_triangles.off",
        "quads.ply",
    ],
)
def test_points_in_faces_stay_where_they_are_on_the_given_mesh(spot, case):
    source, target = subject_of(CASES / "spot_split_at_seam.off"), subject_of(CASES / case)
    mesh, n, rng = target.cleaned.mesh, source.cleaned.mesh.n_vertices, np.random.default_rng(0)
    faces = np.where(np.arange(n) == 3, -1, rng.integers(0, mesh.n_faces, n))
    found = BarycentricMap(faces, rng.dirichlet(np.ones(3), n), mesh.faces, mesh.n_vertices)
    given = on_given_faces(found, source, target)
    np.testing.assert_allclose(
        given.points(target.given), found.points(mesh)[source.cleaned.vertex_map], atol=1e-6 * np.ptp(mesh.vertices)
    )
    assert len(given) == source.given.n_vertices > n
    assert (given.source, given.target) == ("spot_split_at_seam", target.given.name)
    np.testing.assert_array_equal(given.target_faces, target.given.faces)


def test_a_way_is_put_on_the_given_meshes_in_every_form():
    mesh, kept = scattered(blob(2), 10, 1e-3)
    source, target = subject_of(mesh), subject_of(blob(2))
    plain = VertexMap(np.arange(162), 162)
    functional = FunctionalMap(np.eye(2))
    way = Way(plain, functional, precise=lambda: BarycentricMap.of_vertices(plain, blob(2).faces))
    way = on_given(way, source, target)
    assert np.flatnonzero(way.barycentric.faces >= 0).tolist() == sorted(kept)
    np.testing.assert_array_equal(way.barycentric.vertex_map(), way.vertex_map)
    assert way.functional_map is functional
    assert on_given(Way(plain), source, target).barycentric is None


def test_what_is_no_mesh_or_no_way_of_cleaning_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"got an array of shape \(3, 3\) alone; give both"):
        subject_of(np.zeros((3, 3)))
    with pytest.raises(ConfigError, match="clean=full; wanted auto or off"):
        subject_of(blob(2), "full")
    broken = Mesh(np.where(np.arange(162)[:, None] == 3, np.nan, blob(2).vertices), blob(2).faces)
    write_mesh(tmp_path / "nan.off", broken)
    with pytest.raises(MeshError, match=r"nan\.off"):
        match_meshes(tmp_path / "nan.off", blob(2), "hks")
