from __future__ import annotations

import numpy as np
import pytest

from csm.data.registry import recognise
from csm.data.shrec19 import REMESHED, Shrec19DataModule
from csm.data.store import Store
from csm.descriptors import HKS
from tests.data import layouts

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}


def test_layout(tmp_path):
    shapes = recognise(layouts.shrec19(tmp_path))
    assert (shapes.layout, shapes.name) == (REMESHED, "SHREC19_5k_remeshed")
    assert shapes.names == ("1", "2", "10")
    assert shapes.mapped == ("1", "10")
    assert shapes.mapped_pairs == (("1", "10"),)
    missing = [m.path for m in shapes.missing]
    assert "derived_smpl_vts/2.vts" in missing
    assert "44.obj" in missing


def test_only_mapped_shapes_train_and_test(tmp_path):
    data = Shrec19DataModule(layouts.shrec19(tmp_path / "s"), n_train=1, store=Store(tmp_path / "store"), **CHEAP)
    assert (data.split.train, data.split.test) == (("1",), ("10",))
    assert data.n_classes == 40


@pytest.mark.data
def test_real_shrec19_goes_onto_the_template_of_faust(data_set, tmp_path):
    data = Shrec19DataModule(data_set("SHREC19_5k_remeshed"), store=Store(tmp_path), **CHEAP)
    assert len(data.split.train) + len(data.split.test) == 37
    assert data.train_set.load(data.split.test[0]).truth.n_from == 6890


@pytest.mark.data
def test_real_maps_go_from_template_to_shape(data_set):
    """Neighbouring template points must be neighbours on the shape: true only for the right direction and base."""
    faust = recognise(data_set("FAUST_6890")).mesh("tr_reg_000")
    shape = recognise(data_set("SHREC19_5k_remeshed")).load("1")
    size = np.sqrt(shape.mesh.area)
    on_shape = shape.mesh.vertices[shape.truth.indices]
    edge = np.linalg.norm(on_shape[faust.faces[:, 0]] - on_shape[faust.faces[:, 1]], axis=1)
    assert np.percentile(edge, 99) < 0.1 * size
    shifted = shape.mesh.vertices[(shape.truth.indices + 1) % shape.mesh.n_vertices]
    edge = np.linalg.norm(shifted[faust.faces[:, 0]] - shifted[faust.faces[:, 1]], axis=1)
    assert np.percentile(edge, 99) > 0.3 * size
