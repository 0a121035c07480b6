from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
import torch

from csm._types import Arrays
from csm.data.datamodule import to_sample
from csm.data.folder import recognise
from csm.data.prepare import Job, Recipe, compute_features, is_prepared, prepare, prepare_shape
from csm.data.store import Store, read_entry
from csm.descriptors import ACD
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators
from csm.operators.stencils.wavelets import Wavelets
from tests.toyset import write_toys

RECIPE = Recipe(ACD(angles=3, k=5, order=2), 10)


@pytest.fixture
def toys(tmp_path):
    return recognise(write_toys(tmp_path / "toys", 4))


def jobs(shapes) -> list[Job]:
    return [Job(shapes, name) for name in shapes.names]


@pytest.mark.parametrize("workers", [0, 2])
def test_a_second_run_finds_everything(toys, tmp_path, workers):
    store = Store(tmp_path / "store")
    first = prepare(jobs(toys), RECIPE, store, workers=workers, progress=False)
    second = prepare(jobs(toys), RECIPE, store, workers=workers, progress=False)
    assert (first.made, first.present, first.failures) == (4, 0, [])
    assert (second.made, second.present) == (0, 4)


def test_a_stencil_of_more_eigenpairs_than_the_basis_leaves_the_basis_in_the_store(toys, tmp_path):
    recipe, store = Recipe(ACD(angles=3, k=5, order=2), 10, (Wavelets(k=12, n_filters=4),)), Store(tmp_path / "store")
    assert prepare(jobs(toys), recipe, store, workers=0, progress=False).made == 4
    assert prepare(jobs(toys), recipe, store, workers=0, progress=False).present == 4


def test_entries_that_are_there_are_not_read(toys, tmp_path, monkeypatch):
    store, read = Store(tmp_path / "store"), []
    prepare(jobs(toys), RECIPE, store, workers=0, progress=False)

    def watched(path):
        read.append(path)
        return read_entry(path)

    monkeypatch.setattr("csm.data.store.read_entry", watched)
    assert prepare(jobs(toys), RECIPE, store, workers=0, progress=False).present == 4
    assert read == []
    for name in toys.names:
        prepare_shape(toys.load(name), RECIPE, store)
    assert sorted(read) == store.files()
    assert store.computed == 0


@pytest.mark.parametrize("kind", ["descriptor", "lbo"])
def test_a_cut_entry_is_made_again_at_once_and_a_faulty_one_when_it_is_loaded(toys, tmp_path, caplog, kind):
    store, shape = Store(tmp_path / "store"), toys.load("toy0")
    sound = prepare_shape(shape, RECIPE, store)
    (path,) = [file for file in store.files() if file.parent.name == kind]
    content = bytearray(path.read_bytes())
    path.write_bytes(content[: len(content) // 2])
    assert prepare(jobs(toys)[:1], RECIPE, store, workers=0, progress=False).made == 1
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    assert prepare(jobs(toys)[:1], RECIPE, store, workers=0, progress=False).present == 1
    caplog.clear()
    again = prepare_shape(shape, RECIPE, store)
    assert "computing it again" in caplog.text
    np.testing.assert_array_equal(again.features, sound.features)
    np.testing.assert_array_equal(again.basis.evals, sound.basis.evals)


def test_an_interrupted_run_goes_on_where_it_was(toys, tmp_path):
    store = Store(tmp_path / "store")
    prepare(jobs(toys)[:3], RECIPE, store, workers=0, progress=False)
    summary = prepare(jobs(toys), RECIPE, store, workers=0, progress=False)
    assert (summary.made, summary.present) == (1, 3)


def test_one_bad_shape_does_not_stop_the_others_and_is_named(toys, tmp_path):
    mesh = toys.load("toy0").mesh
    lonely = Mesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0]]]), mesh.faces)
    write_mesh(tmp_path / "toys" / "toy1.off", lonely)
    (tmp_path / "toys" / "toy2.off").write_text("OFF\n3 1 0\n0 0 0\n")
    summary = prepare(jobs(toys), RECIPE, Store(tmp_path / "store"), workers=0, progress=False)
    assert summary.made == 2
    assert [label for label, _ in summary.failures] == ["toys/toy1", "toys/toy2"]
    assert "toy2.off" in summary.table()


def test_features_are_the_descriptor_in_float32(toys, tmp_path):
    mesh = toys.load("toy3").mesh
    features = compute_features(mesh, RECIPE.descriptor, Store(tmp_path / "store"))
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, RECIPE.descriptor(mesh).values, rtol=1e-6)


def test_another_parameter_is_another_entry(toys, tmp_path):
    store, shape = Store(tmp_path / "store"), toys.load("toy0")
    prepare_shape(shape, RECIPE, store)
    before = store.computed
    prepare_shape(shape, Recipe(ACD(angles=3, k=5, order=2, sweeps=2), 10), store)
    assert store.computed == before + 1


@dataclass(frozen=True)
class Valence:
    """A stencil for this test: how many edges meet in a vertex, plus a parameter."""

    more: int = 0
    name: ClassVar[str] = "valence"

    def __call__(self, operators: Operators) -> Arrays:
        return {"count": np.bincount(operators.mesh.faces.ravel()) + self.more, "mass": operators.mass}

    def parameters(self) -> dict[str, Any]:
        return {"more": self.more}


def test_stencils_are_kept_in_the_store_and_reach_the_sample(toys, tmp_path):
    store, shape = Store(tmp_path / "store"), toys.load("toy0")
    wanting = replace(RECIPE, stencils=(Valence(more=2),))
    prepare_shape(shape, RECIPE, store)
    assert is_prepared(shape.mesh, RECIPE, store)
    assert not is_prepared(shape.mesh, wanting, store)
    tensors = to_sample(prepare_shape(shape, wanting, store)).surface.stencil("valence")
    assert is_prepared(shape.mesh, wanting, store)
    assert not is_prepared(shape.mesh, replace(RECIPE, stencils=(Valence(),)), store)
    np.testing.assert_array_equal(tensors["count"], np.bincount(shape.mesh.faces.ravel()) + 2)
    assert tensors["count"].dtype == torch.int64
    assert tensors["mass"].dtype == torch.float32
    assert tensors["mass"].sum().item() == pytest.approx(1.0), "stencils are of the unit-area copy"
