from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.data.datamodule import to_sample
from csm.data.datasets import FaustDataModule, ScapeDataModule, Shrec19DataModule, ToscaDataModule
from csm.data.prepare import Prepared, Recipe, prepare_shape
from csm.data.shapeset import Shape
from csm.data.splits import Split, read_split
from csm.data.store import Store
from csm.descriptors import ACD
from csm.errors import DataError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from tests.conftest import ROOT
from tests.shapes import blob
from tests.toyset import toy_datamodule, write_toys

CHEAP = {"descriptor": ACD(angles=3, k=4, order=1), "basis_k": 8, "workers": 0}


@pytest.fixture(scope="module")
def toys(tmp_path_factory):
    datamodule = toy_datamodule(tmp_path_factory.mktemp("toys"))
    datamodule.prepare_data()
    return datamodule


def test_a_batch_is_one_shape_with_its_tensors(toys):
    batches = list(toys.train_dataloader())
    assert sorted(b.name for b in batches) == list(toys.fit_names)
    sample = batches[0]
    assert sample.features.shape == (162, 16)
    assert sample.surface.basis.evecs.shape == (162, 24)
    assert sample.features.dtype == sample.surface.basis.evecs.dtype == torch.float32
    torch.testing.assert_close(sample.rows, torch.arange(162))
    torch.testing.assert_close(sample.classes, torch.arange(162))
    assert (toys.n_features, toys.n_classes) == (16, 162)


def test_the_basis_is_orthonormal_on_the_unit_area_shape(toys):
    basis = next(iter(toys.train_dataloader())).surface.basis
    gram = basis.evecs.T @ (basis.mass[:, None] * basis.evecs)
    torch.testing.assert_close(gram, torch.eye(24), atol=1e-4, rtol=0)
    assert basis.mass.sum().item() == pytest.approx(1.0, abs=1e-5)


def test_classes_without_a_vertex_are_left_out_and_labels_may_repeat(tmp_path):
    mesh = blob(2)
    truth = np.arange(162)
    truth[[3, 5]] = [-1, 4]
    shape = Shape(mesh, PointMap(truth, Direction.TEMPLATE_TO_SHAPE, 162))
    prepared = prepare_shape(shape, Recipe(CHEAP["descriptor"], 8), Store(tmp_path))
    sample = to_sample(Prepared(shape, prepared.features, prepared.basis))
    assert 3 not in sample.classes
    assert sample.rows[sample.classes == 5].item() == 4
    assert len(sample.rows) == 161


def test_held_out_shapes_are_not_fitted_and_the_protocol_says_so(tmp_path):
    datamodule = toy_datamodule(tmp_path, holdout=1)
    assert datamodule.validation_names == (datamodule.split.train[-1],)
    assert set(datamodule.fit_names).isdisjoint(datamodule.validation_names)
    assert "1 held-out training shapes" in datamodule.protocol
    assert "also fitted" in toy_datamodule(tmp_path / "b").protocol


def test_a_shape_that_the_split_names_and_the_folder_lacks_is_reported(tmp_path):
    write_toys(tmp_path / "toys", 2)
    datamodule = toy_datamodule(tmp_path, split=Split("mine", ("toy0", "toy99"), ("toy1",)))
    with pytest.raises(DataError, match=r"1 of the 2 train shapes of split mine are missing \(toy99\)"):
        datamodule.prepare_data()


def test_a_folder_without_the_set_names_what_was_wanted(tmp_path):
    with pytest.raises(DataError, match="wanted FAUST_6890 or FAUST_MPI"):
        FaustDataModule(tmp_path, split=Split("s", ("a",), ("b",)), **CHEAP)


@pytest.mark.data
def test_faust_trains_on_one_resolution_and_tests_on_others(data_set, tmp_path, monkeypatch):
    roots = {data_set(name) for name in ("FAUST_6890", "FAUST_10000")}
    for root in roots:
        (tmp_path / root.name).symlink_to(root)
    datamodule = FaustDataModule(
        tmp_path, test=(6890, 10000), split=ROOT / "conf/split/faust_80_20.json", store=Store(tmp_path / "s"), **CHEAP
    )
    assert list(datamodule.test_sets) == ["FAUST_6890", "FAUST_10000"]
    assert len(datamodule.fit_names) == 80
    fine = datamodule.load(datamodule.test_sets["FAUST_10000"], "tr_reg_080")
    assert (len(fine.sample.features), len(fine.sample.rows)) == (10000, 6890)


@pytest.mark.data
def test_scape_classes_reach_vertices_through_labels(data_set, tmp_path):
    datamodule = ScapeDataModule(
        data_set("SCAPE_5000"), split=ROOT / "conf/split/scape_51_20.json", store=Store(tmp_path), **CHEAP
    )
    sample = datamodule.load(datamodule.train_set, "mesh000").sample
    assert len(sample.classes) == 5000
    assert len(torch.unique(sample.rows)) < 5000
    assert sample.rows.max() < len(sample.features)


@pytest.mark.data
def test_scape_is_tested_in_other_triangulations_that_the_user_has(data_set, tmp_path):
    split = ROOT / "conf/split/scape_51_20.json"
    for k, name in enumerate(read_split(split).test):
        write_mesh(tmp_path / f"SCAPE_12500/{name}.off", Mesh((1 + k) * blob(2).vertices, blob(2).faces))
    datamodule = ScapeDataModule(
        data_set("SCAPE_5000"), test_roots=[tmp_path / "SCAPE_12500"], split=split, store=Store(tmp_path / "s"), **CHEAP
    )
    assert list(datamodule.test_sets) == ["SCAPE_5000", "SCAPE_12500"]
    fine = datamodule.test_sets["SCAPE_12500"]
    assert datamodule.test_names(fine) == datamodule.split.test
    assert (datamodule.load(fine, "mesh052").shape.truth.indices == np.arange(162)).all()


@pytest.mark.data
def test_tosca_and_shrec19(data_set, tmp_path):
    tosca = ToscaDataModule(data_set("TOSCA_5k_remeshed"), category="wolf", n_train=2, store=Store(tmp_path), **CHEAP)
    assert tosca.split.train == ("wolf0", "wolf1")
    with pytest.raises(DataError, match="the classes are cat, centaur"):
        ToscaDataModule(data_set("TOSCA_5k_remeshed"), category="fish", **CHEAP)
    shrec = Shrec19DataModule(data_set("SHREC19_5k_remeshed"), store=Store(tmp_path), **CHEAP)
    assert len(shrec.split.train) + len(shrec.split.test) == 37
    assert shrec.load(shrec.train_set, shrec.split.test[0]).shape.truth.n_from == 6890
