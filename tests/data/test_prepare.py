from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from csm._signals import Stopped, Terminated
from csm._types import Arrays
from csm.data.prepare import Job, Recipe, features_of, is_prepared, prepare, prepare_mesh, shared_operators
from csm.data.registry import recognise
from csm.data.store import Store, read_entry
from csm.descriptors import ACD, HKS, WEDS, WKS
from csm.descriptors.base import record
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from csm.operators import Operators, spectrum
from csm.operators.stencils import Stencil
from csm.operators.stencils.wavelets import Wavelets
from tests.shapes import blob
from tests.toyset import write_toys

ACD_SMALL = ACD(angles=3, k=6, order=2)
RECIPE = Recipe(ACD_SMALL, 10)


@pytest.fixture
def toys(tmp_path):
    return recognise(write_toys(tmp_path / "toys", 4))


@pytest.fixture
def solves(monkeypatch) -> list[int]:
    """A list that gets the number of eigenpairs of every eigenproblem that is solved."""
    asked = []

    def counted(stiffness, mass, k, **options):
        asked.append(k)
        return spectrum.eigenpairs(stiffness, mass, k, **options)

    monkeypatch.setattr("csm.operators.operators.eigenpairs", counted)
    return asked


def jobs(shapes) -> list[Job]:
    return [Job(shapes, name) for name in shapes.names]


@pytest.mark.parametrize("workers", [0, 2])
def test_a_second_run_finds_everything(toys, tmp_path, workers):
    store = Store(tmp_path / "store")
    first = prepare(jobs(toys), [RECIPE], store, workers=workers, progress=False)
    second = prepare(jobs(toys), [RECIPE], store, workers=workers, progress=False)
    assert (first.made, first.present, first.failures) == (4, 0, [])
    assert (second.made, second.present) == (0, 4)


def test_a_stencil_of_more_eigenpairs_than_the_basis_leaves_the_basis_in_the_store(toys, tmp_path):
    recipe, store = replace(RECIPE, stencils=(Wavelets(k=12, n_filters=4, tolerance=0.01),)), Store(tmp_path / "store")
    assert prepare(jobs(toys), [recipe], store, workers=0, progress=False).made == 4
    assert prepare(jobs(toys), [recipe], store, workers=0, progress=False).present == 4


def test_entries_that_exist_are_not_read(toys, tmp_path, monkeypatch):
    store, read = Store(tmp_path / "store"), []
    prepare(jobs(toys), [RECIPE], store, workers=0, progress=False)

    def watched(path):
        read.append(path)
        return read_entry(path)

    monkeypatch.setattr("csm.data.store.read_entry", watched)
    assert prepare(jobs(toys), [RECIPE], store, workers=0, progress=False).present == 4
    assert read == []
    for name in toys.names:
        prepare_mesh(toys.mesh(name), RECIPE, store)
    assert sorted(read) == store.files()
    assert store.computed == 0


@pytest.mark.parametrize("kind", ["descriptor", "lbo"])
def test_a_cut_entry_is_computed_again_at_once_and_a_faulty_one_when_it_is_loaded(toys, tmp_path, caplog, kind):
    store, mesh = Store(tmp_path / "store"), toys.mesh("toy0")
    sound = prepare_mesh(mesh, RECIPE, store)
    (path,) = [file for file in store.files() if file.parent.name == kind]
    content = bytearray(path.read_bytes())
    path.write_bytes(content[: len(content) // 2])
    assert prepare(jobs(toys)[:1], [RECIPE], store, workers=0, progress=False).made == 1
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    assert prepare(jobs(toys)[:1], [RECIPE], store, workers=0, progress=False).present == 1
    caplog.clear()
    again = prepare_mesh(mesh, RECIPE, store)
    assert "computing it again" in caplog.text
    np.testing.assert_array_equal(again.features, sound.features)
    np.testing.assert_array_equal(again.basis.evals, sound.basis.evals)


def test_an_interrupted_run_goes_on_where_it_was(toys, tmp_path):
    store = Store(tmp_path / "store")
    prepare(jobs(toys)[:3], [RECIPE], store, workers=0, progress=False)
    summary = prepare(jobs(toys), [RECIPE], store, workers=0, progress=False)
    assert (summary.made, summary.present) == (1, 3)


class Stopping:
    """A set that is stopped by the user when one of its shapes is read."""

    def __init__(self, shapes, at: str, stop: type[KeyboardInterrupt]) -> None:
        self.name, self.names, self._shapes, self._at, self._stop = shapes.name, shapes.names, shapes, at, stop

    def load(self, name: str):
        if name == self._at:
            raise self._stop
        return self._shapes.load(name)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, Terminated])
def test_a_stopped_run_says_what_is_kept_and_how_to_go_on(toys, tmp_path, stop):
    store = Store(tmp_path / "store")
    with pytest.raises(Stopped if stop is KeyboardInterrupt else stop) as caught:
        prepare(jobs(Stopping(toys, "toy2", stop)), [RECIPE], store, workers=0, progress=False)
    assert str(caught.value) == "2 of 4 shapes are in the store; run the same command again to go on"
    summary = prepare(jobs(toys), [RECIPE], store, workers=0, progress=False)
    assert (summary.made, summary.present) == (2, 2)


def test_one_bad_shape_does_not_stop_the_others_and_is_named(toys, tmp_path):
    mesh = toys.load("toy0").mesh
    lonely = Mesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0]]]), mesh.faces)
    write_mesh(tmp_path / "toys" / "toy1.off", lonely)
    (tmp_path / "toys" / "toy2.off").write_text("OFF\n3 1 0\n0 0 0\n")
    summary = prepare(jobs(toys), [RECIPE], Store(tmp_path / "store"), workers=0, progress=False)
    assert summary.made == 2
    assert [label for label, _ in summary.failures] == ["toys/toy1", "toys/toy2"]
    assert "toy2.off" in summary.table()


def test_features_are_the_descriptor_in_float32(toys, tmp_path):
    mesh = toys.load("toy3").mesh
    features = features_of(mesh, RECIPE.descriptor, Store(tmp_path / "store"))
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, RECIPE.descriptor(mesh).values, rtol=1e-6)


def test_another_parameter_is_another_entry(toys, tmp_path):
    store, mesh = Store(tmp_path / "store"), toys.mesh("toy0")
    prepare_mesh(mesh, RECIPE, store)
    before = store.computed
    prepare_mesh(mesh, replace(RECIPE, descriptor=replace(ACD_SMALL, order=1)), store)
    assert store.computed == before + 1


def test_recipes_of_one_shape_share_its_eigenproblem(toys, tmp_path, solves):
    write_mesh(tmp_path / "fine" / "a.off", blob(3))
    fine, store = recognise(tmp_path / "fine"), Store(tmp_path / "store")
    recipes = [Recipe(HKS(k=300), 128), Recipe(WEDS(), 64), Recipe(WKS(k=100), 0)]
    summary = prepare(jobs(fine), recipes, store, workers=0, progress=False)
    assert (summary.made, summary.failures, solves) == (1, [], [301])
    kept = sorted(entry.params["k"] for entry in store.check()[0] if entry.kind == "lbo")
    assert kept == [64, 128]
    alone = HKS(k=300)(fine.mesh("a")).values
    np.testing.assert_allclose(features_of(fine.mesh("a"), HKS(k=300), store), alone, rtol=1e-5)
    assert prepare(jobs(fine), recipes, store, workers=0, progress=False).present == 1
    assert len(solves) == 2, "that of the comparison only"


@pytest.mark.parametrize("basis_k", [5, 20])
def test_one_recipe_solves_one_eigenproblem(toys, tmp_path, solves, basis_k):
    mesh, store = toys.mesh("toy0"), Store(tmp_path / "store")
    prepared = prepare_mesh(mesh, Recipe(HKS(k=10, n_times=3), basis_k), store)
    assert solves == [max(10, basis_k)]
    assert prepared.basis.evecs.shape == (162, basis_k)


def test_operators_are_shared_where_they_are_given(toys, tmp_path, solves):
    mesh, store = toys.mesh("toy0"), Store(tmp_path / "store")
    recipes = [Recipe(HKS(k=12, n_times=3), 12), Recipe(WKS(k=10), 4)]
    operators = shared_operators(mesh, recipes, store)
    for recipe in recipes:
        prepare_mesh(mesh, recipe, store, operators)
    assert solves == [12]


def test_several_recipes_are_present_only_together(toys, tmp_path):
    store, other = Store(tmp_path / "store"), Recipe(WKS(k=8), 10)
    prepare(jobs(toys)[:1], [RECIPE], store, workers=0, progress=False)
    before = len(store.files())
    assert prepare(jobs(toys)[:1], [RECIPE, other], store, workers=0, progress=False).made == 1
    assert len(store.files()) == before + 1, "the basis was in the store"


def test_a_recipe_without_basis_keeps_none(toys, tmp_path):
    store, mesh, recipe = Store(tmp_path / "store"), toys.mesh("toy0"), Recipe(HKS(k=8, n_times=3), 0)
    assert not is_prepared(mesh, recipe, store)
    assert prepare(jobs(toys)[:1], [recipe], store, workers=0, progress=False).made == 1
    assert [path.parent.name for path in store.files()] == ["descriptor"]
    assert is_prepared(mesh, recipe, store)
    prepared = prepare_mesh(mesh, recipe, store)
    assert (prepared.basis, prepared.stencils, store.computed) == (None, {}, 0)


TETRAHEDRON = Mesh(
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
)


@pytest.mark.parametrize(
    ("descriptor", "name"),
    [
        (HKS(k=4, n_times=3), "d4595794d736701cced654392189561a816c024d.npz"),
        (ACD.paper(), "f46694f4f30816f8403983cc7b2376d849a39e54.npz"),
    ],
)
def test_keys_are_those_of_stores_that_were_filled_earlier(tmp_path, descriptor, name):
    assert Store(tmp_path).path("descriptor", TETRAHEDRON, record(descriptor)).name == name


@dataclass(frozen=True)
class Valence(Stencil):
    """A stencil for this test: how many edges meet in a vertex, plus a parameter."""

    more: int = 0
    name: ClassVar[str] = "valence"

    def __call__(self, operators: Operators) -> Arrays:
        return {"count": np.bincount(operators.mesh.faces.ravel()) + self.more, "mass": operators.mass}


class ChangedHKS(HKS):
    """HKS as if its formula had changed."""

    version: ClassVar[int] = 2


class ChangedValence(Valence):
    """The stencil as if its computation had changed."""

    version: ClassVar[int] = 2


def test_another_version_of_a_formula_is_another_entry(toys, tmp_path):
    store, mesh = Store(tmp_path / "store"), toys.mesh("toy0")
    old = Recipe(HKS(k=8, n_times=3), 0, (Valence(),))
    prepare_mesh(mesh, old, store)
    assert is_prepared(mesh, old, store)
    assert not is_prepared(mesh, replace(old, descriptor=ChangedHKS(k=8, n_times=3)), store)
    assert not is_prepared(mesh, replace(old, stencils=(ChangedValence(),)), store)


def test_stencils_are_kept_in_the_store(toys, tmp_path):
    store, mesh = Store(tmp_path / "store"), toys.mesh("toy0")
    wanting = replace(RECIPE, stencils=(Valence(more=2),))
    prepare_mesh(mesh, RECIPE, store)
    assert is_prepared(mesh, RECIPE, store)
    assert not is_prepared(mesh, wanting, store)
    found = prepare_mesh(mesh, wanting, store).stencils["valence"]
    assert is_prepared(mesh, wanting, store)
    assert not is_prepared(mesh, replace(RECIPE, stencils=(Valence(),)), store)
    np.testing.assert_array_equal(found["count"], np.bincount(mesh.faces.ravel()) + 2)
    assert found["mass"].sum() == pytest.approx(1.0), "stencils are of the unit-area copy"
