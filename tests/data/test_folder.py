from __future__ import annotations

import numpy as np
import pytest

from csm.commands.prepare import all_jobs
from csm.data.folder import PLAIN, FolderDataModule
from csm.data.registry import recognise
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import ConfigError, DataError
from csm.mesh.correspondence import ground_truth
from csm.mesh.io import write_map, write_mesh
from csm.mesh.shape import Mesh
from tests.shapes import blob, sphere
from tests.toyset import write_toys

CHEAP = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0}


def test_one_connectivity(tmp_path):
    ball = sphere(1)
    for name, scale in (("a", 1.0), ("b2", 2.0), ("b10", 3.0)):
        write_mesh(tmp_path / f"{name}.ply", Mesh(ball.vertices * scale, ball.faces))
    shapes = recognise(tmp_path)
    assert (shapes.layout, shapes.name) == (PLAIN, tmp_path.name)
    assert shapes.names == ("a", "b2", "b10")
    assert len(ground_truth(shapes.load("a").truth, shapes.load("b10").truth)) == ball.n_vertices


def test_several_connectivities_have_no_map(tmp_path):
    write_mesh(tmp_path / "a.off", sphere(1))
    write_mesh(tmp_path / "b.off", Mesh(sphere(1).vertices, sphere(1).faces[::-1]))
    shapes = recognise(tmp_path)
    assert shapes.load("a").truth.indices.tolist() == list(range(42))
    with pytest.raises(DataError, match=r"b\.off.*triangles differ.*corres/b\.vts"):
        shapes.load("b")


@pytest.mark.parametrize("place", ["", "off"])
def test_maps(tmp_path, place):
    write_mesh(tmp_path / place / "a.off", sphere(1))
    write_mesh(tmp_path / place / "b.off", blob(2))
    write_map(tmp_path / "corres" / "a.vts", np.array([3, 1]))
    write_map(tmp_path / "corres" / "a.sym.vts", np.array([1, 3]))
    shapes = recognise(tmp_path)
    assert shapes.mapped == ("a",)
    assert shapes.load("a").mirror.indices.tolist() == [1, 3]
    assert [m.path for m in shapes.missing] == ["corres/b.vts"]


def test_shapes_that_pairs_name_are_missed(tmp_path):
    write_mesh(tmp_path / "a.off", sphere(1))
    (tmp_path / "test_pairs.txt").write_text("a c\n")
    shapes = recognise(tmp_path)
    assert [(m.path, m.origin) for m in shapes.missing] == [("c", "named in test_pairs.txt")]
    assert shapes.extras == (tmp_path / "test_pairs.txt",)


def test_the_last_fifth_of_a_folder_is_tested_on_unless_told_otherwise(tmp_path):
    root, options = write_toys(tmp_path / "toys"), {"store": Store(tmp_path / "store"), **CHEAP}
    data = FolderDataModule(root, **options)
    assert (data.split.name, data.split.test) == ("toys", ("toy4", "toy5"))
    assert data.split.train == ("toy0", "toy1", "toy2", "toy3")
    assert FolderDataModule(root, n_test=3, **options).split.test == ("toy3", "toy4", "toy5")
    mine = Split("mine", ("toy5",), ("toy0",))
    assert FolderDataModule(root, split=mine, **options).split is mine


def test_another_folder_is_tested_on(tmp_path):
    root, other = write_toys(tmp_path / "toys"), write_toys(tmp_path / "others", 6, 3)
    data = FolderDataModule(root, [other], store=Store(tmp_path / "store"), **CHEAP)
    assert list(data.test_sets) == ["others"]
    assert data.test_names(data.test_sets["others"]) == ("toy4", "toy5")


@pytest.mark.parametrize("n_test", [-1, 0, 2, 3])
def test_a_split_without_training_or_test_shapes_is_refused(tmp_path, n_test):
    root = write_toys(tmp_path / "toys", 2)
    with pytest.raises(DataError, match=f"2 shapes .* cannot be divided into training shapes and {n_test} test"):
        FolderDataModule(root, n_test=n_test, **CHEAP)


def test_a_single_shape_cannot_be_divided(tmp_path):
    with pytest.raises(DataError, match=r"1 shape .* cannot be divided"):
        FolderDataModule(write_toys(tmp_path / "toys", 1), **CHEAP)


@pytest.mark.parametrize(("n", "n_test"), [(2, 1), (3, 2), (6, 2), (14, 2), (15, 3)])
def test_by_default_two_or_more_shapes_are_left_for_the_test(tmp_path, n, n_test):
    """A test is of pairs; of two shapes one has to be trained on."""
    for i in range(n):
        write_mesh(tmp_path / f"s{i:02}.off", sphere(0))
    data = FolderDataModule(tmp_path, **CHEAP)
    assert (len(data.split.train), len(data.split.test)) == (n - n_test, n_test)


def test_folders_of_one_name_are_different_sets(tmp_path):
    """Results, and the list of what is prepared, call sets by their names."""
    root, p, q = (write_toys(tmp_path / name / "meshes", 4) for name in ("train", "p", "q"))
    data = FolderDataModule(root, [p, q], **CHEAP)
    assert data.train_set.name == "train-meshes"
    assert {name: shapes.root for name, shapes in data.test_sets.items()} == {"p-meshes": p, "q-meshes": q}
    assert len(all_jobs(data)) == 2 + 2 * 2
    same = FolderDataModule(root, [root], **CHEAP)
    assert (same.train_set.name, list(same.test_sets)) == ("meshes", ["meshes"])


def test_a_folder_that_is_there_twice_is_refused(tmp_path):
    root = write_toys(tmp_path / "toys", 4)
    with pytest.raises(DataError, match="only 1 different names"):
        FolderDataModule(root, [root, tmp_path / "." / "toys"], **CHEAP)


def test_the_first_shape_does_not_decide_alone_about_the_others(tmp_path):
    """One that cannot be read, or has other triangles than all others, is the one that is named."""
    root = write_toys(tmp_path / "toys", 4)
    (root / "toy0.off").write_text("nonsense")
    assert len(recognise(root).load("toy2").truth.indices) == 162
    write_mesh(root / "toy0.off", blob(1))
    shapes = recognise(root)
    assert len(shapes.load("toy2").truth.indices) == 162
    with pytest.raises(DataError, match=r"toy0\.off: .*triangles differ from those of toy1"):
        shapes.load("toy0")


@pytest.mark.parametrize("workers", ["abc", -1, True, 1.5])
def test_workers_that_are_no_number_are_refused_before_anything_is_read(tmp_path, workers):
    with pytest.raises(ConfigError, match="workers="):
        FolderDataModule(write_toys(tmp_path / "toys", 3), **(CHEAP | {"workers": workers}))
