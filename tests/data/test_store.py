from __future__ import annotations

import multiprocessing
import os
import time

import numpy as np
import pytest

from csm.data.store import SCHEMA, Store, read_entry
from csm.errors import DataError
from csm.mesh.shape import Mesh
from tests.shapes import sphere, torus


@pytest.fixture
def store(tmp_path) -> Store:
    return Store(tmp_path / "store")


def arrays() -> dict[str, np.ndarray]:
    return {"a": np.arange(12.0).reshape(3, 4), "names": np.array(["x", "yy"])}


def never() -> dict[str, np.ndarray]:
    raise AssertionError("the entry should have been found")


def test_what_was_made_is_found_again_with_its_types(store):
    store.fetch("kind", sphere(1), {"k": 3}, arrays)
    found = store.fetch("kind", sphere(1), {"k": 3}, never)
    np.testing.assert_array_equal(found["a"], arrays()["a"])
    assert list(found["names"]) == ["x", "yy"]
    assert store.computed == 1


@pytest.mark.parametrize(
    ("kind", "mesh", "params"),
    [("other", sphere(1), {"k": 3}), ("kind", torus(), {"k": 3}), ("kind", sphere(1), {"k": 4})],
)
def test_kind_geometry_and_each_parameter_are_part_of_the_key(store, kind, mesh, params):
    store.fetch("kind", sphere(1), {"k": 3}, arrays)
    assert not store.has(kind, mesh, params)


def test_the_name_and_the_order_of_parameters_are_not_part_of_the_key(store):
    mesh = sphere(1)
    store.fetch("kind", mesh, {"a": 1, "b": 2}, arrays)
    assert store.has("kind", Mesh(mesh.vertices, mesh.faces, "other name"), {"b": 2, "a": 1})


def test_the_smallest_move_of_a_vertex_is_another_entry(store):
    mesh = sphere(1)
    store.fetch("kind", mesh, {}, arrays)
    moved = mesh.vertices.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], 2)
    assert not store.has("kind", Mesh(moved, mesh.faces), {})


TETRAHEDRON = Mesh(
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("lbo", "a861ef3c6391ffc29e4f1ffed86c198893193146.npz"),
        ("stencil-x", "fa4aab6533298fcabc6ec8b93035e2636b4961f9.npz"),
    ],
)
def test_keys_never_change(store, kind, name):
    assert store.path(kind, TETRAHEDRON, {"k": 3}) == store.root / kind / name


def test_reading_computes_nothing(store):
    assert store.read("kind", sphere(1), {"k": 3}) is None
    store.fetch("kind", sphere(1), {"k": 3}, arrays)
    np.testing.assert_array_equal(store.read("kind", sphere(1), {"k": 3})["a"], arrays()["a"])
    assert store.read("kind", sphere(1), {"k": 4}) is None
    assert store.computed == 1


def test_an_entry_describes_itself(store):
    store.fetch("kind", sphere(1), {"k": 3}, arrays)
    (entry,), faults = store.check()
    assert (entry.kind, entry.shape, entry.params, entry.schema, faults) == ("kind", "sphere", {"k": 3}, SCHEMA, [])


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "text"])
def test_a_damaged_entry_is_named_refused_and_computed_again(store, caplog, damage):
    store.fetch("kind", sphere(1), {}, arrays)
    path = store.path("kind", sphere(1), {})
    content = bytearray(path.read_bytes())
    if damage == "flip":
        content[len(content) // 2] ^= 0xFF
    path.write_bytes({"cut": content[: len(content) // 2], "flip": content, "empty": b"", "text": b"hello"}[damage])
    with pytest.raises(DataError, match=path.name):
        read_entry(path)
    found = store.fetch("kind", sphere(1), {}, arrays)
    np.testing.assert_array_equal(found["a"], arrays()["a"])
    assert path.name in caplog.text
    assert "computing it again" in caplog.text
    store.fetch("kind", sphere(1), {}, never)


def test_a_foreign_npz_and_another_schema_are_refused(store, monkeypatch):
    store.fetch("kind", sphere(1), {}, arrays)
    path = store.path("kind", sphere(1), {})
    monkeypatch.setattr("csm.data.store.SCHEMA", SCHEMA + 1)
    with pytest.raises(DataError, match=f"of schema {SCHEMA}"):
        read_entry(path)
    np.savez(path, a=1)
    with pytest.raises(DataError, match="not an entry"):
        read_entry(path)


def test_an_entry_with_pickled_objects_is_refused(store):
    store.fetch("kind", sphere(1), {}, arrays)
    path = store.path("kind", sphere(1), {})
    with path.open("wb") as file:
        np.savez(file, a=np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match=path.name):
        read_entry(path)


def test_a_failing_computation_leaves_nothing_behind(store):
    def fail() -> dict[str, np.ndarray]:
        raise DataError("no")

    with pytest.raises(DataError):
        store.fetch("kind", sphere(1), {}, fail)
    assert not list(store.root.rglob("*.npz"))


def test_prune_deletes_waste_and_nothing_else(store):
    store.fetch("kind", sphere(1), {}, arrays)
    store.fetch("kind", torus(), {}, arrays)
    broken = store.path("kind", torus(), {})
    broken.write_bytes(b"")
    foreign = store.root / "kind" / "mine.npz"
    foreign.write_bytes(b"not csm's")
    old, young = (broken.with_name(f".x.{n}.tmp.npz") for n in ("old", "young"))
    for path in (old, young):
        path.write_bytes(b"")
    os.utime(old, (time.time() - 7200,) * 2)
    assert set(store.prune()) == {broken, old}
    assert foreign.exists()
    assert young.exists()
    assert store.has("kind", sphere(1), {})


def test_prune_by_age(store):
    store.fetch("kind", sphere(1), {}, arrays)
    path = store.path("kind", sphere(1), {})
    os.utime(path, (time.time() - 10 * 86400,) * 2)
    assert store.prune(unused_days=20) == []
    os.utime(path, (time.time() - 10 * 86400,) * 2)
    assert store.prune(unused_days=5) == [path]


def _write_many(root: str, barrier) -> None:
    store = Store(root)
    barrier.wait()
    for k in range(20):
        store.fetch("kind", sphere(1), {"k": k}, lambda: {"a": np.full(50_000, 7.0)})


def test_processes_may_write_the_same_entries_at_once(store):
    context = multiprocessing.get_context("fork")
    barrier = context.Barrier(3)
    workers = [context.Process(target=_write_many, args=(str(store.root), barrier)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert [worker.exitcode for worker in workers] == [0, 0, 0]
    sound, faults = store.check()
    assert (len(sound), faults) == (20, [])
    assert not list(store.root.rglob(".*"))


def test_the_default_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "here"))
    assert Store().root == tmp_path / "here"
