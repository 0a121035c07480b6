from __future__ import annotations

from collections import Counter

import pytest
import torch

from csm.data.faust import FaustDataModule
from csm.data.scape import ScapeDataModule
from csm.data.store import Store
from csm.descriptors import HKS
from csm.learning.loading import LightningData
from csm.learning.samples import shape_sample
from tests.learning.toys import make, train
from tests.toyset import toy_datamodule

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}


@pytest.fixture(scope="module")
def toys(tmp_path_factory) -> LightningData:
    loaded = LightningData(toy_datamodule(tmp_path_factory.mktemp("toys")))
    loaded.prepare_data()
    return loaded


def test_a_batch_is_one_shape_with_its_tensors(toys):
    batches = list(toys.train_dataloader())
    assert sorted(b.name for b in batches) == list(toys.data.fit_names)
    sample = batches[0]
    assert sample.features.shape == (162, 16)
    assert sample.surface.basis.evecs.shape == (162, 24)
    assert sample.features.dtype == sample.surface.basis.evecs.dtype == torch.float32
    torch.testing.assert_close(sample.rows, torch.arange(162))
    torch.testing.assert_close(sample.classes, torch.arange(162))
    assert (toys.n_features, toys.data.n_classes) == (16, 162)


def test_validation_shapes_come_in_order_and_training_shapes_in_a_new_one(toys):
    assert [b.name for b in toys.val_dataloader()] == list(toys.data.validation_names)
    torch.manual_seed(0)
    orders = {tuple(b.name for b in toys.train_dataloader()) for _ in range(20)}
    assert len(orders) > 3


def test_the_basis_is_orthonormal_on_the_unit_area_shape(toys):
    basis = next(iter(toys.train_dataloader())).surface.basis
    gram = basis.evecs.T @ (basis.mass[:, None] * basis.evecs)
    torch.testing.assert_close(gram, torch.eye(24), atol=1e-4, rtol=0)
    assert basis.mass.sum().item() == pytest.approx(1.0, abs=1e-5)


def test_shapes_are_prepared_read_and_converted_once(tmp_path, monkeypatch):
    loaded = LightningData(toy_datamodule(tmp_path))
    read, prepared = Counter(), []
    load, prepare = type(loaded.data.train_set).load, loaded.data.prepare

    def counting(shapes, name):
        read[name] += 1
        return load(shapes, name)

    monkeypatch.setattr(type(loaded.data.train_set), "load", counting)
    monkeypatch.setattr(loaded.data, "prepare", lambda: prepared.append(1) or prepare())
    loaded.prepare_data()
    train(make(loaded), loaded, tmp_path, 2)
    loaded.prepare_data()
    assert read == dict.fromkeys(loaded.data.fit_names, 1)
    assert prepared == [1]
    name = loaded.data.fit_names[0]
    assert loaded.sample(name) is loaded.sample(name)


def test_a_preparation_that_failed_is_tried_again(tmp_path, monkeypatch):
    loaded = LightningData(toy_datamodule(tmp_path))
    monkeypatch.setattr(loaded.data, "prepare", lambda: 1 / 0)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            loaded.prepare_data()


@pytest.mark.data
def test_faust_trains_on_one_resolution_and_tests_on_others(data_set, tmp_path):
    roots = {data_set(name) for name in ("FAUST_6890", "FAUST_10000")}
    for root in roots:
        (tmp_path / root.name).symlink_to(root)
    data = FaustDataModule(tmp_path, test=(6890, 10000), store=Store(tmp_path / "s"), **CHEAP)
    assert list(data.test_sets) == ["FAUST_6890", "FAUST_10000"]
    assert len(data.fit_names) == 80
    fine = data.test_sets["FAUST_10000"].load("tr_reg_080")
    assert (fine.mesh.n_vertices, len(fine.truth.known)) == (10000, 6890)


@pytest.mark.data
def test_scape_classes_reach_vertices_through_labels(data_set, tmp_path):
    data = ScapeDataModule(data_set("SCAPE_5000"), store=Store(tmp_path), **CHEAP)
    sample = shape_sample(data.prepared("mesh000"), data.shape("mesh000").truth)
    assert len(sample.classes) == 5000
    assert len(torch.unique(sample.rows)) < 5000
    assert sample.rows.max() < len(sample.features)
