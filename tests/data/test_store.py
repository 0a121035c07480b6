from __future__ import annotations

import multiprocessing
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import csm
from csm.data.entries import KINDS, SCHEMA
from csm.data.store import Store
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


def test_a_failing_computation_leaves_nothing_behind(store):
    def fail() -> dict[str, np.ndarray]:
        raise DataError("no")

    with pytest.raises(DataError):
        store.fetch("kind", sphere(1), {}, fail)
    assert not list(store.root.rglob("*.npz"))


def test_prune_deletes_waste_and_nothing_else(store):
    store.fetch("lbo", sphere(1), {}, arrays)
    store.fetch("lbo", torus(), {}, arrays)
    broken = store.path("lbo", torus(), {})
    broken.write_bytes(b"")
    foreign = store.root / "lbo" / "mine.npz"
    foreign.write_bytes(b"not csm's")
    old, young = (broken.with_name(f".{broken.stem}.{n}.tmp.npz") for n in ("0a1b2c3d", "4e5f6071"))
    theirs = broken.with_name(".x.0a1b2c3d.tmp.npz")
    for path in (old, young, theirs):
        path.write_bytes(b"")
    for path in (old, theirs):
        os.utime(path, (time.time() - 7200,) * 2)
    assert set(store.prune()) == {broken, old}
    assert all(path.exists() for path in (foreign, young, theirs))
    assert store.has("lbo", sphere(1), {})


def test_files_of_other_programs_are_never_deleted(store):
    """Their names look like entries; what decides is the content, and the folder where that cannot be read."""
    name = "0123456789abcdef0123456789abcdef01234567"
    photos = store.root / "photos"
    photos.mkdir(parents=True)
    (photos / f"{name}.npz").write_bytes(b"a picture")
    (photos / f".{name}.0a1b2c3d.tmp.npz").write_bytes(b"")
    np.savez(photos / f"{name[::-1]}.npz", pixels=np.zeros(3))
    (store.root / "lbo").mkdir()
    np.savez(store.root / "lbo" / f"{name}.npz", evals=np.zeros(3))
    (store.root / "lbo" / f"{name[::-1]}.npz").mkdir()
    for path in store.root.rglob("*.npz"):
        os.utime(path, (time.time() - 90 * 86400,) * 2)
    before = sorted(store.root.rglob("*"))
    assert store.prune(unused_days=1) == []
    assert sorted(store.root.rglob("*")) == before


def test_prune_deletes_entries_of_unknown_kinds_only_if_they_are_entries(store):
    store.fetch("mine", sphere(1), {"k": 1}, arrays)
    store.fetch("mine", sphere(1), {"k": 2}, arrays)
    first, second = (store.path("mine", sphere(1), {"k": k}) for k in (1, 2))
    first.replace(second)
    assert store.prune() == [second]


def test_prune_follows_a_link_to_the_store(store, tmp_path):
    store.fetch("lbo", sphere(1), {}, arrays)
    store.path("lbo", sphere(1), {}).write_bytes(b"cut")
    (tmp_path / "link").symlink_to(store.root)
    assert len(Store(tmp_path / "link").prune()) == 1
    assert store.files() == []


def test_the_kinds_that_csm_writes_are_known():
    """So that what is damaged is deleted: every kind that stands in a call of the store."""
    package = Path(csm.__file__).parent
    text = "\n".join(path.read_text() for path in package.rglob("*.py"))
    kinds = set(re.findall(r"""(?:\.fetch\(|measured\(context,|_spectrum\()\s*f?"([^"]+)\"""", text))
    assert {"descriptor", "geodesic-row", "matched", "remesh", "lbo", "descriptor-time"} <= kinds
    assert [kind for kind in kinds if not KINDS.fullmatch(kind)] == []


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


def test_a_store_that_cannot_be_written_is_one_warning_and_not_the_end(tmp_path, caplog):
    (tmp_path / "file").write_text("this is no folder")
    for root in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / ("x" * 300)):
        store = Store(root)
        caplog.clear()
        for k in (1, 2):
            np.testing.assert_array_equal(store.fetch("lbo", sphere(1), {"k": k}, arrays)["a"], arrays()["a"])
        assert store.computed == 2
        assert not store.has("lbo", sphere(1), {"k": 1})
        assert caplog.text.count("the store cannot be written") == 1
        assert str(root) in caplog.text
        assert "cannot be written" in store.why_not_writable()
    assert Store(tmp_path / "new").why_not_writable() is None
    assert list((tmp_path / "new").iterdir()) == []


FULL = """
import resource, sys
import numpy as np
from csm.data.store import Store
from tests.shapes import sphere
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
store = Store(sys.argv[1])
for k in range(3):
    assert store.fetch("lbo", sphere(1), {"k": k}, lambda: {"a": np.full(10_000, 7.0)})["a"].sum() == 70_000
assert store.fetch("lbo", sphere(1), {"k": "small"}, lambda: {"a": np.full(10, 7.0)})["a"].sum() == 70
"""


@pytest.mark.skipif(sys.platform == "win32", reason="files cannot be limited in size")
def test_a_disk_that_gets_full_leaves_what_is_kept_whole(store):
    """Where a file cannot grow, as on a full disk, the arrays are used, said once to be lost, and nothing is left."""
    store.fetch("lbo", sphere(1), {}, arrays)
    ran = subprocess.run([sys.executable, "-c", FULL, str(store.root)], capture_output=True, text=True, check=True)
    assert ran.stderr.count("cannot be written") == 1
    sound, faults = store.check()
    assert (sorted(str(entry.params) for entry in sound), faults) == (["{'k': 'small'}", "{}"], [])
    assert not list(store.root.rglob(".*"))


def test_a_clock_that_was_wrong_does_no_harm(store):
    store.fetch("lbo", sphere(1), {}, arrays)
    os.utime(store.path("lbo", sphere(1), {}), (time.time() + 90 * 86400,) * 2)
    assert store.prune(unused_days=1) == []
    store.fetch("lbo", sphere(1), {}, never)
