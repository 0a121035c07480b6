import os
import signal
import stat

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from csm.errors import DataError
from csm.mesh.io import (
    atomic_path,
    copy_file,
    file_digest,
    list_files,
    list_folders,
    natural_key,
    read_bytes,
    write_mesh,
)
from tests.shapes import blob


def test_atomic_path_keeps_the_old_file_when_the_writer_fails(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")

    def write_half():
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            assert target.read_text() == "old"
            raise RuntimeError("killed")

    with pytest.raises(RuntimeError):
        write_half()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_atomic_path_makes_folders_and_leaves_one_file(tmp_path):
    target = tmp_path / "new" / "deep" / "a.npz"
    with atomic_path(target) as temporary:
        assert temporary.parent == target.parent
        assert temporary.suffix == ".npz"
        temporary.write_bytes(b"x")
    assert [p.name for p in target.parent.iterdir()] == ["a.npz"]


def write(path, text="new"):
    with atomic_path(path) as temporary:
        temporary.write_text(text)


def test_a_link_stays_and_the_file_it_points_to_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "a.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "a.txt")
    (tmp_path / "over.txt").symlink_to("link.txt")
    (tmp_path / "dangling.txt").symlink_to(tmp_path / "real" / "b.txt")
    write(tmp_path / "over.txt")
    write(tmp_path / "dangling.txt")
    assert (tmp_path / "over.txt").is_symlink()
    assert {p.name: p.read_text() for p in (tmp_path / "real").iterdir()} == {"a.txt": "new", "b.txt": "new"}


def test_permissions_of_a_replaced_file_stay_and_a_new_one_has_the_usual(tmp_path):
    (tmp_path / "a.off").write_text("old")
    (tmp_path / "a.off").chmod(0o640)
    write_mesh(tmp_path / "a.off", blob(1))
    write_mesh(tmp_path / "b.off", blob(1))
    usual = os.umask(0)
    os.umask(usual)
    assert stat.S_IMODE((tmp_path / "a.off").stat().st_mode) == 0o640
    assert stat.S_IMODE((tmp_path / "b.off").stat().st_mode) == 0o666 & ~usual


@pytest.mark.parametrize("name", ["x" * 251 + ".off", "a." + "y" * 253, "é" * 125 + ".off", "\N{GRINNING FACE}" * 62])
def test_the_temporary_name_fits_where_the_name_fits(tmp_path, name):
    write(tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_the_temporary_of_a_hidden_or_odd_name_is_hidden(tmp_path):
    for name in (".a", "a", "a.tar.gz", "a b.off"):
        with atomic_path(tmp_path / name) as temporary:
            assert temporary.name.startswith(".")
            assert temporary.suffix == (tmp_path / name).suffix or ".tmp" in temporary.name
            temporary.write_text("")


REFUSED = {
    "folder": "folder: cannot be written: there is a folder of this name",
    "file/a.txt": "file/a.txt: cannot be written: .*is a file, wanted a folder",
    "file/deep/a.txt": "file/deep/a.txt: cannot be written: .*is a file, wanted a folder",
    "loop": "loop: cannot be written: it is a link in a circle",
    "pipe": "pipe: cannot be written: it is no file",
    "x" * 256: "x: cannot be written",
    "a\0b": "cannot be written",
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes in the file system")
@pytest.mark.parametrize(("name", "message"), REFUSED.items())
def test_places_that_cannot_be_written_are_named_before_anything_is_computed(tmp_path, monkeypatch, name, message):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("mine")
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match=message):
        write(name)
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 0)() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_named(tmp_path):
    (tmp_path / "r").mkdir(mode=0o500)
    with pytest.raises(DataError, match=r"r/a\.txt: cannot be written \(Permission denied\)"):
        write(tmp_path / "r" / "a.txt")


def test_a_full_disk_is_named_and_the_old_file_stays(tmp_path):
    """A limit on the size of files stands for the full disk: the write fails half way."""
    resource = pytest.importorskip("resource")
    (tmp_path / "a.ply").write_text("old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(DataError, match=r"a\.ply: cannot be written \(File too large\)"):
            write_mesh(tmp_path / "a.ply", blob(2))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert [p.name for p in tmp_path.iterdir()] == ["a.ply"]
    assert (tmp_path / "a.ply").read_text() == "old"


def test_an_error_about_another_file_inside_the_block_is_not_blamed_on_the_target(tmp_path):
    with pytest.raises(FileNotFoundError, match="other"), atomic_path(tmp_path / "a.txt"):
        (tmp_path / "other").read_text()


@settings(deadline=None)
@given(st.lists(st.integers(0, 10**6), unique=True))
def test_natural_order_is_the_order_of_numbers(numbers):
    names = [f"cat{n}" for n in numbers]
    assert sorted(names, key=natural_key) == [f"cat{n}" for n in sorted(numbers)]


@settings(deadline=None)
@given(st.lists(st.text(max_size=8), unique=True), st.randoms())
def test_natural_order_is_an_order_of_any_names(names, random):
    keys = sorted(natural_key(name) for name in names)
    random.shuffle(names)
    assert [natural_key(name) for name in sorted(names, key=natural_key)] == keys


def test_list_files_is_natural_and_skips_hidden_and_other_files(tmp_path):
    for name in ("10.off", "9.off", "2.OFF", ".1.tmp.off", "a.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "3.off").mkdir()
    assert [p.name for p in list_files(tmp_path, ".off")] == ["2.OFF", "9.off", "10.off"]
    assert list_files(tmp_path / "nowhere", ".off") == []


def test_list_folders_goes_down_to_depth(tmp_path):
    (tmp_path / "a" / "b" / "c").mkdir(parents=True)
    assert [p.name for p in list_folders(tmp_path)] == ["a"]
    assert [p.name for p in list_folders(tmp_path, 3)] == ["a", "b", "c"]


def test_read_bytes_names_the_file(tmp_path):
    with pytest.raises(DataError, match="nowhere"):
        read_bytes(tmp_path / "nowhere")
    with pytest.raises(DataError, match="folder"):
        read_bytes(tmp_path)


def test_copy_file_copies_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"\0\1")
    copy_file(tmp_path / "a", tmp_path / "deep" / "b")
    assert (tmp_path / "deep" / "b").read_bytes() == b"\0\1"


def test_copy_file_names_a_source_that_is_missing_and_a_target_that_cannot_be(tmp_path):
    with pytest.raises(DataError, match="nowhere: there is no such file"):
        copy_file(tmp_path / "nowhere", tmp_path / "b")
    (tmp_path / "a").write_bytes(b"")
    with pytest.raises(DataError, match=r"a/b: cannot be written"):
        copy_file(tmp_path / "a", tmp_path / "a" / "b")


def test_the_digest_of_a_file_is_its_sha256(tmp_path):
    (tmp_path / "abc").write_bytes(b"abc")  # the example of FIPS 180-4
    wanted = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert file_digest(tmp_path / "abc") == wanted
