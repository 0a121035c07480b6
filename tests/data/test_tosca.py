from __future__ import annotations

import pytest

from csm.data.registry import recognise
from csm.data.splits import Split
from csm.data.store import Store
from csm.data.tosca import SGA18, ToscaDataModule
from csm.descriptors import HKS
from csm.errors import DataError
from tests.data import layouts

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}


@pytest.mark.parametrize("below", ["", "vtx_5k"])
def test_every_class_has_a_template(tmp_path, below):
    shapes = recognise(layouts.sga18(tmp_path) / below)
    assert (shapes.layout, shapes.name) == (SGA18, "TOSCA_5k_remeshed")
    assert shapes.names == ("cat0", "cat10", "dog0")
    assert [e.template for e in shapes.entries] == ["cat", "cat", "dog"]
    assert shapes.pairs == (("cat0", "cat10"), ("cat0", "dog0"))
    assert shapes.mapped_pairs == (("cat0", "cat10"),)
    assert shapes.missing == ()
    shape = shapes.load("cat10")
    assert shape.truth.indices.tolist() == list(range(30))
    assert shape.mirror.indices.tolist() == list(range(30))[::-1]


def test_shapes_that_pairs_name_are_missed(tmp_path):
    layouts.sga18(tmp_path)
    (tmp_path / "vtx_5k" / "cat10.off").unlink()
    shapes = recognise(tmp_path)
    assert "vtx_5k/cat10.off" in [m.path for m in shapes.missing]
    assert shapes.mapped_pairs == ()


def test_a_class_is_divided_or_split_as_given(tmp_path):
    layouts.sga18(tmp_path)
    data = ToscaDataModule(tmp_path, category="cat", n_train=1, store=Store(tmp_path / "store"), **CHEAP)
    assert (data.split.name, data.split.train, data.split.test) == ("tosca_cat", ("cat0",), ("cat10",))
    mine = Split("mine", ("cat10",), ("cat0",))
    assert ToscaDataModule(tmp_path, n_train=1, split=mine, store=Store(tmp_path / "store"), **CHEAP).split is mine
    with pytest.raises(DataError, match=r"class 'fish' has 0 shapes.*the classes are cat, dog"):
        ToscaDataModule(tmp_path, category="fish", **CHEAP)


@pytest.mark.data
def test_real_tosca_has_eight_classes(data_set, tmp_path):
    root = data_set("TOSCA_5k_remeshed")
    data = ToscaDataModule(root, category="wolf", n_train=2, store=Store(tmp_path), **CHEAP)
    assert data.split.train == ("wolf0", "wolf1")
    classes = "cat, centaur, david, dog, horse, michael, victoria, wolf"
    with pytest.raises(DataError, match=f"the classes are {classes}$"):
        ToscaDataModule(root, category="fish", **CHEAP)
    assert all(name in ToscaDataModule.__doc__ for name in classes.split(", "))
