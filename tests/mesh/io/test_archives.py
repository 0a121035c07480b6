import io
import tarfile
import zipfile
from pathlib import Path

import pytest

from csm.errors import DataError
from csm.mesh.io import archives, unpack, unpacked

CASES = Path(__file__).parents[2] / "cases" / "damaged"


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
    with pytest.raises(DataError, match="wanted an archive"):
        unpack(tmp_path, tmp_path)


def tar_with(path: Path, **fields) -> Path:
    with tarfile.open(path, "w") as t:
        info = tarfile.TarInfo("set/a.off")
        for key, value in fields.items():
            setattr(info, key, value)
        t.addfile(info)
    return path


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.FIFOTYPE])
def test_links_devices_and_pipes_in_a_tar_are_refused(tmp_path, kind):
    path = tar_with(tmp_path / "a.tar", type=kind, linkname="b.off")
    with pytest.raises(DataError, match=r"a\.tar: its member set/a\.off is (a link|no file).*does not unpack"):
        unpack(path, tmp_path / "out")
    assert list((tmp_path / "out").rglob("*")) == []


def test_links_in_a_zip_are_refused(tmp_path):
    info = zipfile.ZipInfo("a.off")
    info.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as z:
        z.writestr(info, "/etc/hostname")
    with pytest.raises(DataError, match=r"a\.zip: its member a\.off is a link"):
        unpack(tmp_path / "a.zip", tmp_path / "out")


@pytest.mark.parametrize("name", ["../a.off", "/a.off", "x/../../a.off", "..\\a.off", "C:\\a.off"])
def test_a_zip_may_not_write_outside(tmp_path, name):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as z:
        z.writestr("good.off", "OFF")
        z.writestr(name, "OFF")
    with pytest.raises(DataError, match=r"a\.zip: cannot be unpacked: its member .*points outside"):
        unpack(tmp_path / "a.zip", tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    ("name", "message"), [("encrypted", "encrypted; unpack it yourself"), ("method98", "method 98, which Python")]
)
def test_what_python_cannot_unpack_is_one_sentence(tmp_path, name, message):
    with pytest.raises(DataError, match=rf"{name}\.zip: its member FAUST/\S+ is.*{message}") as caught:
        unpack(CASES / f"{name}.zip", tmp_path)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_archive_that_the_disk_has_no_room_for_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as z:
        z.writestr("zeros", bytes(10**6))
    with tarfile.open(tmp_path / "a.tar.gz", "w:gz") as t:
        info = tarfile.TarInfo("zeros")
        info.size = 10**6
        t.addfile(info, io.BytesIO(bytes(10**6)))
    usage = archives.shutil.disk_usage(tmp_path)._replace(free=10**6 - 1)
    monkeypatch.setattr(archives.shutil, "disk_usage", lambda _: usage)
    for name in ("a.zip", "a.tar.gz"):
        with pytest.raises(DataError, match=rf"{name}: unpacks to 0 MiB more, but .*has 0 MiB left"):
            unpack(tmp_path / name, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []
    monkeypatch.setattr(archives.shutil, "disk_usage", lambda _: usage._replace(free=10**9))
    monkeypatch.setattr(archives, "LARGEST_ARCHIVE", 10**6 - 1)
    for name in ("a.zip", "a.tar.gz"):
        with pytest.raises(DataError, match=rf"{name}: unpacks to more than"):
            unpack(tmp_path / name, tmp_path / "out")


def test_a_cut_or_altered_archive_is_one_sentence(tmp_path):
    with tarfile.open(tmp_path / "a.tar.gz", "w:gz") as t:
        info = tarfile.TarInfo("a")
        info.size = 10**5
        t.addfile(info, io.BytesIO(bytes(range(250)) * 400))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as z:
        z.writestr("a", "OFF" * 1000)
    for name, at in (("a.tar.gz", 60), ("a.zip", 100)):
        data = bytearray((tmp_path / name).read_bytes())
        (tmp_path / f"cut.{name}").write_bytes(data[:-80])
        data[at] ^= 255
        (tmp_path / f"altered.{name}").write_bytes(data)
        for kind in ("cut", "altered"):
            with pytest.raises(DataError, match=rf"{kind}\.{name}: cannot be unpacked"):
                unpack(tmp_path / f"{kind}.{name}", tmp_path / "out")
