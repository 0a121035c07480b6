from __future__ import annotations

import numpy as np
import pytest

from csm.data.registry import recognise
from csm.data.scape import NAMES, RELEASE, SPLIT, ScapeDataModule
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import DataError
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from tests.data import layouts
from tests.shapes import blob

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}


def test_acd_release_of_scape(tmp_path):
    shapes = recognise(layouts.acd(tmp_path))
    assert (shapes.layout, shapes.name) == (RELEASE, "SCAPE_5000")
    assert shapes.lists == {"train": ("mesh000",), "test": ("mesh052",)}
    missing = [m.path for m in shapes.missing]
    assert len(missing) == 2 * 69
    assert "shapes/mesh051.mat" not in missing
    truth = shapes.load("mesh000").truth
    assert (truth.n_from, truth.n_to) == (50, 42)
    assert len(set(truth.indices.tolist())) < 50  # classes share vertices


def test_a_list_that_is_missing_is_named(tmp_path):
    (layouts.acd(tmp_path) / "files_test.txt").unlink()
    shapes = recognise(tmp_path)
    assert shapes.lists == {"train": ("mesh000",)}
    assert "files_test.txt" in [m.path for m in shapes.missing]


def test_the_split_is_that_of_the_release_and_covers_all_shapes():
    assert (len(SPLIT.train), len(SPLIT.test)) == (51, 20)
    assert "mesh051" not in SPLIT.train + SPLIT.test
    assert SPLIT.train + SPLIT.test == NAMES


def test_the_same_bodies_in_other_triangulations_are_tested_on(tmp_path):
    scape = layouts.acd(tmp_path / "scape")
    write_mesh(tmp_path / "SCAPE_12500" / "mesh052.off", blob(2))
    options = {"root": scape, "store": Store(tmp_path / "store"), **CHEAP}
    split = Split("pair", ("mesh000",), ("mesh052",))
    data = ScapeDataModule(test_roots=[tmp_path / "SCAPE_12500"], split=split, **options)
    assert list(data.test_sets) == ["SCAPE_5000", "SCAPE_12500"]
    assert data.test_names(data.test_sets["SCAPE_12500"]) == ("mesh052",)
    assert data.n_classes == 50
    assert ScapeDataModule(**options).split is SPLIT
    with pytest.raises(DataError, match="50 of the 51 train shapes of split scape_51_20 are missing"):
        ScapeDataModule(**options).prepare()


@pytest.mark.data
def test_real_scape_has_no_mesh051_and_its_lists_are_the_split(data_set):
    shapes = recognise(data_set("SCAPE_5000"))
    assert "mesh051" not in shapes.names
    assert shapes.lists == {"train": SPLIT.train, "test": SPLIT.test}
    assert sorted(shapes.lists["train"] + shapes.lists["test"]) == sorted(shapes.names)


@pytest.mark.data
def test_real_scape_classes_share_vertices(data_set, tmp_path):
    data = ScapeDataModule(data_set("SCAPE_5000"), store=Store(tmp_path), **CHEAP)
    shape = data.shape("mesh000")
    known = shape.truth.indices
    assert (data.n_classes, len(known)) == (5000, 5000)
    assert len(np.unique(known)) < 5000
    assert known.max() < shape.mesh.n_vertices


@pytest.mark.data
def test_real_scape_is_tested_in_other_triangulations_that_the_user_has(data_set, tmp_path):
    for k, name in enumerate(SPLIT.test):
        write_mesh(tmp_path / f"SCAPE_12500/{name}.off", Mesh((1 + k) * blob(2).vertices, blob(2).faces))
    data = ScapeDataModule(
        data_set("SCAPE_5000"), test_roots=[tmp_path / "SCAPE_12500"], store=Store(tmp_path / "s"), **CHEAP
    )
    assert list(data.test_sets) == ["SCAPE_5000", "SCAPE_12500"]
    fine = data.test_sets["SCAPE_12500"]
    assert data.test_names(fine) == data.split.test
    assert (fine.load("mesh052").truth.indices == np.arange(162)).all()
