from __future__ import annotations

import numpy as np
import pytest

from csm.data.folder import PLAIN, FolderDataModule
from csm.data.registry import recognise
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import DataError
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
    assert (data.split.name, data.split.test) == ("toys", ("toy5",))
    assert data.split.train == ("toy0", "toy1", "toy2", "toy3", "toy4")
    assert FolderDataModule(root, n_test=3, **options).split.test == ("toy3", "toy4", "toy5")
    mine = Split("mine", ("toy5",), ("toy0",))
    assert FolderDataModule(root, split=mine, **options).split is mine


def test_another_folder_is_tested_on(tmp_path):
    root, other = write_toys(tmp_path / "toys"), write_toys(tmp_path / "others", 6, 3)
    data = FolderDataModule(root, [other], store=Store(tmp_path / "store"), **CHEAP)
    assert list(data.test_sets) == ["others"]
    assert data.test_names(data.test_sets["others"]) == ("toy5",)


@pytest.mark.parametrize("n_test", [-1, 0, 2, 3])
def test_a_split_without_training_or_test_shapes_is_refused(tmp_path, n_test):
    root = write_toys(tmp_path / "toys", 2)
    with pytest.raises(DataError, match=f"2 shapes .* cannot be divided into training shapes and {n_test} test"):
        FolderDataModule(root, n_test=n_test, **CHEAP)


def test_a_single_shape_cannot_be_divided(tmp_path):
    with pytest.raises(DataError, match=r"1 shapes .* cannot be divided"):
        FolderDataModule(write_toys(tmp_path / "toys", 1), **CHEAP)
