from __future__ import annotations

import pickle
from collections import Counter

import numpy as np
import pytest

from csm.data.base import DataModule
from csm.data.prepare import Job
from csm.data.registry import recognise
from csm.data.shapes import InMemory, Shape
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import ConfigError, DataError
from csm.mesh.correspondence import PointMap
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from tests.shapes import blob, sphere
from tests.toyset import write_toys

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}
SPLIT = Split("mine", ("toy0", "toy1", "toy2", "toy3"), ("toy4", "toy5"))


class Counting:
    """A set that counts how often each shape is read."""

    def __init__(self, shapes) -> None:
        self.shapes, self.read = shapes, Counter()
        self.name, self.names = shapes.name, shapes.names

    def load(self, name):
        self.read[name] += 1
        return self.shapes.load(name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_toys(tmp_path_factory.mktemp("base") / "toys")


@pytest.fixture
def toys(folder):
    return Counting(recognise(folder))


def module(shapes, store, split=SPLIT, **options) -> DataModule:
    return DataModule(shapes, [shapes], split, store=Store(store), **(CHEAP | options))


def a_shape(name: str) -> Shape:
    mesh = sphere(1)
    return Shape(Mesh(mesh.vertices, mesh.faces, name), PointMap.identity(mesh.n_vertices))


def test_a_job_in_memory_reaches_a_worker_process_whole():
    job = pickle.loads(pickle.dumps(Job(InMemory([a_shape("a")], "set"), "a")))
    assert job.label == "set/a"
    assert job.shapes.load("a").mesh.digest == a_shape("a").mesh.digest
    np.testing.assert_array_equal(job.shapes.load("a").truth.indices, np.arange(42))


def test_a_training_mesh_is_read_once_also_while_the_store_is_filled(toys, tmp_path):
    data = module(toys, tmp_path)
    data.prepare()
    for name in SPLIT.train:
        prepared = data.prepared(name)
        assert prepared.features.shape == (162, 3)
        assert prepared.basis.evecs.shape == (162, 8)
        assert prepared.mesh is data.shape(name).mesh
    assert (data.n_classes, len(data.validation_shapes())) == (162, 4)
    assert toys.read == dict.fromkeys(SPLIT.train, 1)
    assert data.store.computed == 0, "the preparation filled the store"


def test_a_full_store_is_not_filled_again(toys, tmp_path, monkeypatch):
    module(toys, tmp_path).prepare()
    toys.read.clear()
    monkeypatch.setattr("csm.data.base.prepare", None)
    data = module(toys, tmp_path)
    data.prepare()
    assert [data.prepared(name).mesh.name for name in SPLIT.train] == list(SPLIT.train)
    assert toys.read == dict.fromkeys(SPLIT.train, 1)


def test_only_what_the_store_lacks_is_prepared(toys, tmp_path):
    module(toys, tmp_path, Split("less", ("toy0", "toy1"), ("toy4",))).prepare()
    before = {path: path.stat().st_mtime_ns for path in Store(tmp_path).files()}
    module(toys, tmp_path).prepare()
    after = {path: path.stat().st_mtime_ns for path in Store(tmp_path).files()}
    assert (len(before), len(after)) == (4, 8)
    assert before.items() <= after.items()


def test_held_out_shapes_are_not_fitted_and_the_protocol_says_so(toys, tmp_path):
    data = module(toys, tmp_path, holdout=1)
    assert data.validation_names == (data.split.train[-1],)
    assert set(data.fit_names).isdisjoint(data.validation_names)
    assert "1 held-out training shapes" in data.protocol
    assert "also fitted" in module(toys, tmp_path).protocol


def test_validation_shapes_of_the_split_are_prepared_and_not_fitted(toys, tmp_path):
    split = Split("mine", ("toy0", "toy1"), ("toy4", "toy5"), validation=("toy2", "toy3"))
    data = module(toys, tmp_path, split)
    assert (data.fit_names, data.validation_names) == (split.train, split.validation)
    assert data.validates_unseen
    assert data.protocol.endswith("fitted on 2 shapes of toys, validated on 2 held-out shapes of the split")
    data.prepare()
    assert toys.read == dict.fromkeys(("toy0", "toy1", "toy2", "toy3"), 1)
    assert not module(toys, tmp_path).validates_unseen
    held = module(toys, tmp_path, split, holdout=1)
    assert (held.fit_names, held.validation_names, held.validates_unseen) == (("toy0",), ("toy1",), True)


def test_shapes_that_are_fitted_in_another_form_are_not_unseen(toys, tmp_path):
    split = Split("mine", ("toy0", "toy1"), ("toy4", "toy5"), validation=("s00_p00",))
    assert module(toys, tmp_path, split).validates_unseen
    data = module(toys, tmp_path, split, also=["humans"])
    assert not data.validates_unseen
    assert data.watched.endswith("also fitted")


def test_tests_in_other_forms_come_beside_the_sets(toys, tmp_path):
    data = module(toys, tmp_path, test_forms=["slivers_20", "refined_200"])
    assert list(data.test_sets) == ["toys", "toys_slivers_20", "toys_refined_200"]
    finer = data.test_sets["toys_refined_200"]
    assert data.test_names(finer) == data.test_names(toys)
    assert finer.load("toy4").mesh.n_vertices == 200
    with pytest.raises(ConfigError, match=r"data.test_forms: 'bent_3' is no form of a set; wanted refined_N"):
        module(toys, tmp_path, test_forms=["bent_3"])
    with pytest.raises(DataError, match="only 2 different names"):
        module(toys, tmp_path, test_forms=["slivers_20", "slivers_20"])


def test_a_shape_that_the_split_names_and_the_set_lacks_is_reported(toys, tmp_path):
    data = module(toys, tmp_path, Split("mine", ("toy0", "toy99"), ("toy1", "toy98")))
    with pytest.raises(DataError, match=r"1 of the 2 train shapes of split mine are missing \(toy99\)"):
        data.prepare()
    with pytest.raises(DataError, match=r"1 of the 2 test shapes of split mine are missing \(toy98\)"):
        data.test_names(toys)
    with pytest.raises(DataError, match=r"1 of the 1 validation shapes of split mine are missing \(toy97\)"):
        module(toys, tmp_path, Split("mine", ("toy0",), ("toy1",), validation=("toy97",))).prepare()
    held = Split("mine", ("toy0", "toy1"), ("toy2",), validation=("toy97",))
    module(toys, tmp_path, held, holdout=1).prepare()  # others are held out, so those are not needed


def test_all_shapes_that_cannot_be_used_are_reported_together(tmp_path):
    root = write_toys(tmp_path / "toys", 4)
    mesh = blob(2)
    write_mesh(root / "toy1.off", Mesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0]]]), mesh.faces))
    (root / "toy2.off").write_text("OFF\n3 1 0\n0 0 0\n")
    with pytest.raises(DataError, match=r"2 of 4 shapes cannot be used:\ntoys/toy1 .*\ntoys/toy2 .*toy2\.off"):
        module(recognise(root), tmp_path / "store").prepare()


def test_test_sets_of_one_name_are_refused(toys, tmp_path):
    with pytest.raises(DataError, match=r"2 test sets have only 1 different names \(toys\)"):
        DataModule(toys, [toys, toys], SPLIT, store=Store(tmp_path), **CHEAP)
