import io
import tarfile
import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from csm.errors import DataError
from csm.mesh.io import atomic_path, copy_file, list_files, list_folders, natural_key, read_bytes, unpack, unpacked


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


@pytest.mark.parametrize("kind", ["zip", "tar", "tar.xz", "tar.gz"])
def test_archives_unpack(tmp_path, kind):
    archive = tmp_path / f"set.{kind}"
    if kind == "zip":
        with zipfile.ZipFile(archive, "w") as z:
            z.writestr("set/a.off", "OFF")
    else:
        with tarfile.open(archive, f"w:{kind[4:]}") as t:
            info = tarfile.TarInfo("set/a.off")
            info.size = 3
            t.addfile(info, io.BytesIO(b"OFF"))
    with unpacked(archive) as folder:
        assert (folder / "set" / "a.off").read_text() == "OFF"
    assert not folder.exists()


def test_a_folder_is_its_own_unpacked_form_and_stays(tmp_path):
    with unpacked(tmp_path) as folder:
        assert folder == tmp_path
    assert tmp_path.is_dir()


def test_archives_may_not_write_outside(tmp_path):
    with tarfile.open(tmp_path / "evil.tar", "w") as t:
        info = tarfile.TarInfo("../evil.off")
        info.size = 3
        t.addfile(info, io.BytesIO(b"OFF"))
    with pytest.raises(DataError, match=r"evil\.tar"):
        unpack(tmp_path / "evil.tar", tmp_path / "inside")
    assert not (tmp_path / "evil.off").exists()


def test_what_is_no_archive_is_named(tmp_path):
    (tmp_path / "a.zip").write_bytes(b"not an archive")
    with pytest.raises(DataError, match=r"a\.zip.*wanted a whole"):
        unpack(tmp_path / "a.zip", tmp_path)
    with pytest.raises(DataError, match="no such file"):
        unpack(tmp_path / "b.zip", tmp_path)


def test_read_bytes_names_the_file(tmp_path):
    with pytest.raises(DataError, match="nowhere"):
        read_bytes(tmp_path / "nowhere")
    with pytest.raises(DataError, match="folder"):
        read_bytes(tmp_path)


def test_copy_file_copies_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"\0\1")
    copy_file(tmp_path / "a", tmp_path / "deep" / "b")
    assert (tmp_path / "deep" / "b").read_bytes() == b"\0\1"
