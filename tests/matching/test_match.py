from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh

import csm
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import ConfigError, MeshError
from csm.matching import DescriptorMethod, PrecomputedMethod, match_features, match_meshes
from csm.matching.base import Described
from csm.matching.match import _against_input
from csm.matching.nearest import Nearest, nearest
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from tests.shapes import blob, rotation, torus

CHEAP = HKS(k=20, n_times=8)


@pytest.fixture
def meshes() -> tuple[Mesh, Mesh]:
    mesh = blob(2)
    return mesh, Mesh(3 * mesh.vertices @ rotation().T, mesh.faces, "turned")


def test_a_turned_and_scaled_copy_is_matched_without_error(meshes, tmp_path):
    match = csm.match(*meshes, CHEAP, refine="none", store=Store(tmp_path))
    np.testing.assert_array_equal(match.indices, np.arange(162))
    assert match.coverage == 1.0
    assert (match.source, match.target) == meshes
    assert repr(match) == "Match(blob -> turned by hks, nearest)"
    assert match.vertex_map.source == "blob"


def test_files_presets_methods_and_matchers_are_taken(meshes, tmp_path):
    for mesh in meshes:
        write_mesh(tmp_path / f"{mesh.name}.off", mesh)
    paths, store = [tmp_path / f"{mesh.name}.off" for mesh in meshes], Store(tmp_path / "store")
    match = csm.match(str(paths[0]), paths[1], DescriptorMethod(CHEAP, "mine"), Nearest(), refine="none", store=store)
    assert (match.method.name, match.matcher, match.target.name) == ("mine", Nearest(), "turned")
    assert (match.indices == np.arange(162)).mean() > 0.99
    assert "was fitted on maps by acd; mine exchanges" in match.notes[0]
    by_place = csm.match(paths[0], meshes[0], "xyz", refine="none", store=store)
    assert by_place.coverage == 1.0
    assert "so its confidence" in by_place.notes[0]
    by_acd = csm.match(*meshes, csm.preset("acd", k=10, cuts=4), refine="none", store=store)
    assert not by_acd.notes


def test_all_kinds_of_meshes_are_taken_and_named(meshes, tmp_path):
    store = Store(tmp_path)
    wanted = csm.match(*meshes, CHEAP, refine="none", store=store).indices
    pair = (torch.as_tensor(meshes[0].vertices.copy()), meshes[0].faces.tolist())
    other = trimesh.Trimesh(meshes[1].vertices, meshes[1].faces, process=False)
    match = csm.match(pair, other, CHEAP, refine="none", store=store)
    np.testing.assert_array_equal(match.indices, wanted)
    assert repr(match) == "Match(source -> target by hks, nearest)"


def test_the_old_name_still_does_the_same():
    assert match_meshes is csm.match is csm.match_meshes


def test_everything_that_the_store_lacks_is_kept_in_it(meshes, tmp_path):
    store = Store(tmp_path)
    csm.match(*meshes, CHEAP, refine="none", store=store)
    assert store.computed == 2
    csm.match(*meshes, CHEAP, refine="none", store=store)
    assert store.computed == 2


def test_what_cannot_be_matched_is_named(meshes, tmp_path):
    store = Store(tmp_path)
    with pytest.raises(ConfigError, match="nearest or argmax"):
        csm.match(*meshes, CHEAP, "votes", refine="none", store=store)
    with pytest.raises(ConfigError, match="needs a trained network"):
        csm.match(*meshes, CHEAP, "argmax", refine="none", store=store)
    with pytest.raises(MeshError, match=r"gone\.off"):
        csm.match(tmp_path / "gone.off", meshes[1], CHEAP, refine="none", store=store)
    with pytest.raises(ConfigError, match="not finite"):
        csm.match(
            *meshes,
            PrecomputedMethod({m.name: torch.full((162, 1), torch.nan) for m in meshes}),
            refine="none",
            store=store,
        )


def test_features_are_matched_as_they_are():
    match = match_features(np.array([[0.0], [0.1], [5.0]]), np.arange(4.0)[:, None], source_name="a", target_name="b")
    assert match.indices.tolist() == [0, 0, 3]
    assert (match.coverage, match.source, match.target) == (0.5, "a", "b")
    features = CHEAP(blob(2))
    np.testing.assert_array_equal(match_features(features, features).indices, nearest(features, features))
    tensors = torch.as_tensor(np.asarray(features))
    np.testing.assert_array_equal(match_features(tensors, features.values).indices, np.arange(162))


def test_a_network_that_knows_such_shapes_less_than_its_input_is_warned_of(meshes):
    ball = meshes[0]
    known, mixed = torch.tensor(ball.vertices), torch.tensor(ball.vertices[:1]).repeat(ball.n_vertices, 1)
    lost = Described(ball, mixed + 1e-6 * known, given=known)
    (said,) = _against_input(lost, lost.__class__(ball, mixed, given=known))
    assert "a match without the network" in said
    assert "100 %" in said
    good = Described(ball, known, given=known)
    assert _against_input(good, good) == []
    assert _against_input(Described(ball, known), Described(ball, known)) == []  # no network


def test_a_match_of_symmetric_shapes_says_so_in_both_directions(store):
    lonely = Mesh(np.vstack([torus().vertices, [[9.0, 9, 9]]]), torus().faces, "torus")
    found = csm.match(lonely, torus(), store=store)
    for one in (found, found.inverse):
        assert "one of several equally good ones" in one.confidence.verdict
    other = csm.match(lonely, torus(), refine="joint", store=store)
    assert "one of several" not in other.confidence.verdict, "one map alone tells nothing of others"
