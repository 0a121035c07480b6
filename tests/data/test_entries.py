"""Everything that can be wrong with a file of a store: it is named, and computed again."""

from __future__ import annotations

import io
import json
import os
import struct
import zipfile

import numpy as np
import pytest

from csm.data.entries import SCHEMA, is_entry, read_entry
from csm.data.store import Store
from csm.errors import DataError
from tests.shapes import sphere, torus


@pytest.fixture
def store(tmp_path) -> Store:
    return Store(tmp_path / "store")


def arrays() -> dict[str, np.ndarray]:
    return {"a": np.arange(12.0).reshape(3, 4), "names": np.array(["x", "yy"])}


def never() -> dict[str, np.ndarray]:
    raise AssertionError("the entry should have been found")


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
    monkeypatch.setattr("csm.data.entries.SCHEMA", SCHEMA + 1)
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


@pytest.fixture
def path(store):
    store.fetch("kind", sphere(1), {}, arrays)
    return store.path("kind", sphere(1), {})


def changed(path, **changes) -> None:
    """Write an entry again with some of its parts changed; a sound file, as restored or edited by hand."""
    with np.load(path) as archive:
        parts = {**{key: archive[key] for key in archive.files}, **changes}
    np.savez(path, **{key: value for key, value in parts.items() if value is not None})


def text(content: str) -> np.ndarray:
    return np.frombuffer(content.encode(), dtype=np.uint8)


def described(path, **changes) -> np.ndarray:
    """Return the description of an entry with changes; None takes a key away."""
    with np.load(path) as archive:
        meta = {**json.loads(bytes(archive["__meta__"])), **changes}
    return text(json.dumps({key: value for key, value in meta.items() if value is not None}))


def assert_made_again(store, path, caplog) -> None:
    with pytest.raises(DataError, match=path.name):
        read_entry(path)
    before = store.computed
    found = store.fetch("kind", sphere(1), {}, arrays)
    np.testing.assert_array_equal(found["a"], arrays()["a"])
    assert store.computed == before + 1
    assert path.name in caplog.text
    assert "computing it again" in caplog.text
    store.fetch("kind", sphere(1), {}, never)


@pytest.mark.parametrize("other", [("kind", sphere(2), {}), ("kind", sphere(1), {"k": 4}), ("other", sphere(1), {})])
def test_an_entry_of_another_geometry_kind_or_parameter_is_not_believed(store, path, caplog, other):
    """As after a backup that was restored wrongly: the file is sound, and its name is right."""
    store.fetch(*other, lambda: {"a": np.zeros(3)})
    path.write_bytes(store.path(*other).read_bytes())
    assert not store.has("kind", sphere(1), {})
    assert_made_again(store, path, caplog)
    assert "another entry than its name says" in caplog.text


@pytest.mark.parametrize(
    "arrays_changed",
    [{"a": np.arange(12.0).reshape(3, 4) + 1e-9}, {"a": np.arange(12.0)}, {"names": None}, {"more": np.zeros(2)}],
)
def test_arrays_that_were_changed_are_not_believed(store, path, caplog, arrays_changed):
    changed(path, **arrays_changed)
    assert_made_again(store, path, caplog)
    assert "checksum" in caplog.text


def test_an_entry_of_older_versions_without_a_checksum_is_used(store, path):
    changed(path, __meta__=described(path, checksum=None))
    assert store.has("kind", sphere(1), {})
    np.testing.assert_array_equal(store.fetch("kind", sphere(1), {}, never)["a"], arrays()["a"])
    changed(path, __meta__=described(path, checksum=None, geometry=torus().digest))
    assert store.read("kind", sphere(1), {}) is None


@pytest.mark.parametrize(
    "meta",
    ["{", "[]", "7", "null", '"text"', "{}", "[" * 100_000, '{"schema": 1}', '{"schema": [1]}'],
)
def test_a_description_that_is_none_is_named(store, path, caplog, meta):
    changed(path, __meta__=text(meta))
    assert not store.has("kind", sphere(1), {})
    assert_made_again(store, path, caplog)


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": None},
        {"geometry": None},
        {"params": None},
        {"created": None},
        {"kind": 3},
        {"params": []},
        {"shape": {}},
    ],
)
def test_a_description_that_lacks_something_is_named(store, path, caplog, changes):
    changed(path, __meta__=described(path, **changes))
    assert not store.has("kind", sphere(1), {})
    assert_made_again(store, path, caplog)


@pytest.mark.parametrize("meta", [np.array([255, 254, 0], dtype=np.uint8), np.array(3.5), np.array(["{}"])])
def test_a_description_that_is_not_text_is_named(store, path, caplog, meta):
    changed(path, __meta__=meta)
    assert_made_again(store, path, caplog)


def test_every_bit_of_the_headers_may_flip(store, path, caplog):
    """An entry with a flipped bit is read as it was written, or named; nothing else is raised."""
    sound = path.read_bytes()
    directory = struct.unpack("<I", sound[-6:-2])[0]  # where the zip's list of its parts begins
    for at in [*range(200), *range(directory, len(sound))]:
        for bit in range(8):
            content = bytearray(sound)
            content[at] ^= 1 << bit
            path.write_bytes(content)
            is_entry(path)
            found = store.read("kind", sphere(1), {})
            assert found is not None or path.name in caplog.text
            assert found is None or np.array_equal(found["a"], arrays()["a"])
            caplog.clear()


def test_a_header_that_announces_more_than_the_file_has_takes_no_memory(store, path, caplog):
    with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"(3, 4), }          ", b"(3, 4000000000), } "))
    assert_made_again(store, path, caplog)


def test_a_packed_entry_is_not_unpacked(store, path, caplog):
    """A zip of some kilobytes may hold gigabytes."""
    with np.load(path) as archive:
        parts = {key: archive[key] for key in archive.files}
    np.savez_compressed(path, **parts)
    assert_made_again(store, path, caplog)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with a name")
def test_a_pipe_is_not_waited_for(store, path, caplog):
    path.unlink()
    os.mkfifo(path)
    assert not store.has("kind", sphere(1), {})
    assert_made_again(store, path, caplog)


def test_a_folder_in_the_place_of_an_entry_is_named_and_stays(store, path, caplog):
    path.unlink()
    (path / "mine").mkdir(parents=True)
    assert not store.has("kind", sphere(1), {})
    assert store.check()[1] == [f"{path}: this is no file, so not an entry of a csm store"]
    np.testing.assert_array_equal(store.fetch("kind", sphere(1), {}, arrays)["a"], arrays()["a"])
    assert "computing it again" in caplog.text
    assert "cannot be written" in caplog.text
    assert (path / "mine").is_dir()


@pytest.mark.parametrize("target", ["a file", "nothing"])
def test_a_link_is_replaced_and_what_it_points_to_is_left(store, path, caplog, tmp_path, target):
    mine = tmp_path / "letter.txt"
    if target == "a file":
        mine.write_text("dear")
    path.unlink()
    path.symlink_to(mine)
    assert not store.has("kind", sphere(1), {})
    assert_made_again(store, path, caplog)
    assert not path.is_symlink()
    assert mine.exists() == (target == "a file")
    assert target == "nothing" or mine.read_text() == "dear"
