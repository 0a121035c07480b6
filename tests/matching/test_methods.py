from __future__ import annotations

import pickle

import numpy as np
import pytest
import torch

from csm.data.prepare import Recipe
from csm.data.store import Store
from csm.descriptors import HKS, preset
from csm.descriptors.base import record
from csm.errors import ConfigError, MeshError
from csm.matching import DescriptorMethod, PrecomputedMethod, as_method, methods
from csm.matching.methods import describe_all
from csm.mesh.shape import Mesh
from tests.shapes import blob

CHEAP = HKS(k=10, n_times=6)


def test_a_descriptor_is_a_method_whose_features_are_kept(tmp_path):
    method, mesh = as_method(CHEAP), blob(2)
    store = Store(tmp_path)
    described = method.describe(mesh, store)
    np.testing.assert_array_equal(described.features.numpy(), CHEAP(mesh).values.astype(np.float32))
    assert (described.mesh, described.classifier, described.store) == (mesh, None, store)
    assert (method.name, method.key, method.recipe) == ("hks", record(CHEAP), Recipe(CHEAP, basis_k=0))
    method.describe(mesh, store)
    assert store.computed == 1


def test_names_do_not_change_what_a_method_is():
    assert DescriptorMethod(CHEAP, "mine").key == DescriptorMethod(CHEAP).key
    assert DescriptorMethod(CHEAP, "mine").name == "mine"
    assert DescriptorMethod(CHEAP).key != DescriptorMethod(HKS(k=11, n_times=6)).key


def test_presets_are_methods_by_their_names():
    method = as_method("acd_paper")
    assert (method.name, method.key) == ("acd_paper", record(preset("acd_paper")))
    assert as_method(method) is method
    with pytest.raises(ConfigError, match="nope"):
        as_method("nope")
    with pytest.raises(ConfigError, match=r"a method is a descriptor, .* got a list"):
        as_method([])


def test_features_land_on_the_device_that_is_asked_for(tmp_path):
    mesh = blob(2)
    given = PrecomputedMethod({mesh.name: torch.zeros(162, 3)})
    for method in (as_method(CHEAP), given):
        assert method.describe(mesh, Store(tmp_path)).features.device.type == "cpu"
        assert method.describe(mesh, Store(tmp_path), "meta").features.device.type == "meta"


def test_a_mesh_that_cannot_be_described_is_an_error_of_the_user(tmp_path):
    with pytest.raises(MeshError):
        as_method(CHEAP).describe(Mesh(blob(2).vertices, np.empty((0, 3), dtype=int)), Store(tmp_path))


def test_features_that_are_there_are_looked_up_by_name(tmp_path):
    mesh = blob(2)
    method = PrecomputedMethod({"blob": torch.ones(162, 2), "short": torch.ones(3, 2)}, "mine")
    assert method.describe(mesh, Store(tmp_path)).features.sum() == 324
    assert (method.name, method.recipe) == ("mine", None)
    with pytest.raises(ConfigError, match=r"mine has no features of 'other'; it has blob, short"):
        method.describe(Mesh(mesh.vertices, mesh.faces, "other"), Store(tmp_path))
    with pytest.raises(ConfigError, match=r"mine: short has 162 vertices, its features 3 rows"):
        method.describe(Mesh(mesh.vertices, mesh.faces, "short"), Store(tmp_path))


def test_features_are_told_apart_by_their_values():
    one, same, other = (PrecomputedMethod({"a": torch.full((3, 2), x)}, "mine").key for x in (1.0, 1.0, 2.0))
    assert one == same != other
    assert PrecomputedMethod({"b": torch.full((3, 2), 1.0)}, "mine").key != one
    assert PrecomputedMethod({"a": torch.full((2, 3), 1.0)}, "mine").key != one


def test_methods_survive_pickling():
    again = pickle.loads(pickle.dumps(DescriptorMethod(CHEAP, "mine")))
    assert (again.name, again.key) == ("mine", record(CHEAP))
    features = PrecomputedMethod({"a": torch.ones(3, 2)})
    assert pickle.loads(pickle.dumps(features)).key == features.key


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_features_may_be_arrays(kind, tmp_path):
    array = np.arange(324, dtype=kind).reshape(162, 2)
    method = PrecomputedMethod({"m": array})
    assert method.key == PrecomputedMethod({"m": torch.from_numpy(array)}).key
    mesh = Mesh(blob(2).vertices, blob(2).faces, "m")
    np.testing.assert_array_equal(method.describe(mesh, Store(tmp_path)).features, array)


def test_features_of_half_precision_have_a_key():
    halves = [torch.arange(6, dtype=torch.bfloat16).reshape(3, 2) + i for i in range(2)]
    first, second = (PrecomputedMethod({"a": half}).key for half in halves)
    assert first != second


def test_meshes_are_described_side_by_side_as_one_after_the_other(tmp_path):
    meshes, method = [blob(2, seed) for seed in (1, 2)], as_method("acd")
    found = describe_all(method, meshes, Store(tmp_path / "a"), embed=True)
    for mesh, each in zip(meshes, found, strict=True):
        alone = method.describe(mesh, Store(tmp_path / "b"))
        np.testing.assert_allclose(each.values, alone.values, rtol=1e-6, atol=1e-9)
        assert "embedded" in vars(each)


def test_the_same_mesh_twice_is_computed_once(tmp_path, monkeypatch):
    monkeypatch.setattr(methods, "thread_map", lambda *_: pytest.fail("two threads would compute it twice"))
    found = describe_all(as_method(CHEAP), [blob(2), blob(2)], Store(tmp_path))
    np.testing.assert_array_equal(found[0].values, found[1].values)
