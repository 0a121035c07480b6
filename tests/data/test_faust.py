from __future__ import annotations

import numpy as np
import pytest

from csm.data.faust import LPS, MPI, RELEASE, SGA18, SPLIT, FaustDataModule, names_of
from csm.data.folder import PLAIN
from csm.data.registry import recognise
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import DataError
from csm.mesh.io import write_mesh
from tests.data import layouts
from tests.shapes import sphere

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}
PAIR = Split("pair", ("tr_reg_000",), ("tr_reg_001",))


def missing(shapes):
    return [m.path for m in shapes.missing]


@pytest.mark.parametrize("below", ["", "MPI-FAUST", "MPI-FAUST/training", "MPI-FAUST/training/registrations"])
def test_mpi_faust_from_any_of_its_folders(tmp_path, below):
    shapes = recognise(layouts.mpi_faust(tmp_path) / below)
    assert (shapes.layout, shapes.name) == (MPI, "FAUST_MPI")
    assert shapes.names == ("tr_reg_000", "tr_reg_001")
    assert len(missing(shapes)) == 98
    assert missing(shapes)[0].endswith("tr_reg_002.ply")
    assert "registration" in shapes.missing[0].origin
    assert "http://faust.is.tue.mpg.de" in shapes.missing[0].origin
    shape = shapes.load("tr_reg_001")
    np.testing.assert_array_equal(shape.truth.indices, np.arange(6890))


def test_mpi_faust_with_scans_only_is_known_and_empty(tmp_path):
    write_mesh(tmp_path / "training" / "scans" / "tr_scan_000.ply", sphere(1))
    shapes = recognise(tmp_path)
    assert shapes.layout is MPI
    assert shapes.names == ()
    assert missing(shapes)[99] == "training/registrations/tr_reg_099.ply"


def test_a_decimated_registration_is_refused(tmp_path):
    write_mesh(tmp_path / "tr_reg_000.ply", sphere(2))
    with pytest.raises(DataError, match=r"tr_reg_000\.ply: has 162 vertices.*first 6890"):
        recognise(tmp_path).load("tr_reg_000")


def test_acd_release_of_faust_names_missing_labels(tmp_path):
    layouts.acd(tmp_path, ("tr_reg_000", "tr_reg_001"))
    (tmp_path / "labels" / "tr_reg_001.mat").unlink()
    shapes = recognise(tmp_path)
    assert shapes.layout is RELEASE
    assert shapes.mapped == ("tr_reg_000",)
    assert "labels/tr_reg_001.mat" in missing(shapes)
    with pytest.raises(DataError, match=r"tr_reg_001\.mat.*its map is missing"):
        shapes.load("tr_reg_001")
    assert shapes.mesh("tr_reg_001").n_vertices == 42


@pytest.mark.parametrize("n", [8000, 10000, 12000, 15000])
def test_lps(tmp_path, n):
    shapes = recognise(layouts.lps(tmp_path, n=n))
    assert (shapes.layout, shapes.name) == (LPS, f"FAUST_{n}")
    truth = shapes.load("tr_reg_081").truth
    assert (truth.n_from, truth.n_to) == (6890, n)
    np.testing.assert_array_equal(truth.indices, np.arange(6890))
    assert len(missing(shapes)) == 98


def test_other_sizes_of_faust_are_no_lps_data(tmp_path):
    assert recognise(layouts.lps(tmp_path, n=9000)).layout is PLAIN


def test_sga18_faust_names_what_is_missing(tmp_path):
    layouts.sga18(tmp_path, ("tr_reg_000", "tr_reg_001", "tr_reg_002"))
    (tmp_path / "vtx_5k" / "corres" / "tr_reg_001.sym.vts").unlink()
    (tmp_path / "test_pairs.txt").unlink()
    shapes = recognise(tmp_path)
    assert shapes.layout is SGA18
    for path in ("vtx_5k/tr_reg_003.off", "vtx_5k/corres/tr_reg_001.sym.vts", "test_pairs.txt"):
        assert path in missing(shapes)
    assert shapes.load("tr_reg_001").mirror is None


def test_the_split_is_the_papers():
    assert (SPLIT.train[0], SPLIT.train[-1], len(SPLIT.train)) == ("tr_reg_000", "tr_reg_079", 80)
    assert (SPLIT.test[0], SPLIT.test[-1], len(SPLIT.test)) == ("tr_reg_080", "tr_reg_099", 20)


def test_one_resolution_is_trained_on_and_others_are_tested_on(tmp_path):
    layouts.mpi_faust(tmp_path / "registrations")
    layouts.lps(tmp_path / "finer", PAIR.train + PAIR.test)
    data = FaustDataModule(tmp_path, test=(6890, 8000), split=PAIR, store=Store(tmp_path / "store"), **CHEAP)
    assert data.train_set.name == "FAUST_MPI"
    assert list(data.test_sets) == ["FAUST_MPI", "FAUST_8000"]
    assert data.n_classes == 6890
    assert FaustDataModule(tmp_path, test=(8000,), store=Store(tmp_path / "store"), **CHEAP).split is SPLIT


def test_the_release_is_preferred_to_the_registrations(tmp_path):
    layouts.mpi_faust(tmp_path / "a")
    layouts.acd(tmp_path / "b", PAIR.train + PAIR.test)
    data = FaustDataModule(tmp_path, test=(6890,), split=PAIR, store=Store(tmp_path / "store"), **CHEAP)
    assert data.train_set.name == "FAUST_6890"
    assert names_of(8000) == ("FAUST_8000",)


def test_a_folder_without_the_set_names_what_was_wanted(tmp_path):
    with pytest.raises(DataError, match="wanted FAUST_6890 or FAUST_MPI"):
        FaustDataModule(tmp_path, **CHEAP)
    with pytest.raises(DataError, match=r"wanted faust_80_20 or faust_held_out, or the path of a json file"):
        FaustDataModule(layouts.mpi_faust(tmp_path), test=(6890,), split="faust_90_10", **CHEAP)


def test_the_published_split_fits_all_its_training_shapes_and_says_so(tmp_path):
    data = FaustDataModule(layouts.mpi_faust(tmp_path), test=(6890,), **CHEAP)
    assert (data.fit_names, data.validates_unseen) == (SPLIT.train, False)
    assert "validated on the last 10 training shapes, which are also fitted" in data.protocol
    assert FaustDataModule(layouts.mpi_faust(tmp_path), test=(6890,), holdout=10, **CHEAP).validates_unseen


def test_bodies_with_other_triangles_are_tested_on_beside_those_that_are_fitted(tmp_path):
    layouts.mpi_faust(tmp_path / "FAUST_MPI")
    layouts.sga18(tmp_path / "FAUST_5k_remeshed", ("tr_reg_000", "tr_reg_001", "tr_reg_002"))
    data = FaustDataModule(tmp_path, test=(6890, 5000), **CHEAP)
    assert list(data.test_sets) == ["FAUST_MPI", "FAUST_5k_remeshed"]


@pytest.mark.data
def test_real_faust_trains_on_one_resolution_and_tests_on_others(data_set, tmp_path):
    for root in {data_set(name) for name in ("FAUST_6890", "FAUST_10000")}:
        (tmp_path / root.name).symlink_to(root)
    data = FaustDataModule(tmp_path, test=(6890, 10000), store=Store(tmp_path / "s"), **CHEAP)
    assert list(data.test_sets) == ["FAUST_6890", "FAUST_10000"]
    assert len(data.fit_names) == 80
    fine = data.test_sets["FAUST_10000"]
    assert data.test_names(fine) == SPLIT.test
    shape = fine.load("tr_reg_080")
    assert shape.mesh.n_vertices == 10000
    np.testing.assert_array_equal(shape.truth.indices, np.arange(6890))


@pytest.mark.data
def test_real_remeshed_faust_has_a_hundred_pairs_of_the_same_person(data_set):
    pairs = recognise(data_set("FAUST_5k_remeshed")).pairs
    assert sum(int(a[-3:]) // 10 == int(b[-3:]) // 10 for a, b in pairs) == 100


@pytest.mark.data
def test_real_mirror_maps_flip_left_and_right(data_set):
    shape = recognise(data_set("FAUST_5k_remeshed")).load("tr_reg_000")
    straight, flipped = (shape.mesh.vertices[m.indices] for m in (shape.truth, shape.mirror))
    moved = np.linalg.norm(straight - flipped, axis=1)
    assert np.median(moved) > 0.1 * np.sqrt(shape.mesh.area)
    assert (moved < 0.05 * np.sqrt(shape.mesh.area)).mean() > 0.02  # points near the plane of symmetry hardly move
