import multiprocessing
import shutil
import tarfile
import zipfile

import pytest

from csm.data.registry import recognise
from csm.data.scape import RELEASE
from csm.data.shrec19 import REMESHED
from csm.data.tosca import SGA18
from csm.data.unpacking import lay_out, script, unpack
from csm.errors import DataError
from csm.mesh.io import write_mesh
from tests.data import layouts
from tests.shapes import blob


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_download_is_found_copied_and_recognised(tmp_path):
    layouts.acd(tmp_path / "in" / "repo" / "datasets" / "SCAPE")
    before = contents(tmp_path / "in")
    (found,) = unpack(tmp_path / "in", tmp_path / "out", [RELEASE], progress=False)
    assert found.shapes.root == tmp_path / "out" / "SCAPE_5000"
    assert contents(tmp_path / "out" / "SCAPE_5000") == contents(tmp_path / "in" / "repo" / "datasets" / "SCAPE")
    assert contents(tmp_path / "in") == before
    assert "2 shapes, 2 with correspondence" in str(found)
    assert all(row.usable for row in found.rows)


def test_only_what_belongs_to_the_set_is_copied(tmp_path):
    layouts.sga18(tmp_path / "in")
    (tmp_path / "in" / "virus.exe").write_text("")
    unpack(tmp_path / "in", tmp_path / "out", [SGA18], progress=False)
    copied = {str(p) for p in contents(tmp_path / "out" / "TOSCA_5k_remeshed")}
    assert "test_pairs.txt" in copied
    assert "virus.exe" not in copied
    assert len(copied) == 1 + 3 * 3


def test_archives_are_unpacked(tmp_path):
    layouts.shrec19(tmp_path / "in")
    with tarfile.open(tmp_path / "set.tar.xz", "w:xz") as archive:
        archive.add(tmp_path / "in", "anything")
    (found,) = unpack(tmp_path / "set.tar.xz", tmp_path / "out", [REMESHED], progress=False)
    assert found.shapes.names == ("1", "2", "10")


def test_another_set_is_refused_with_the_address(tmp_path):
    layouts.shrec19(tmp_path / "in")
    with pytest.raises(DataError, match=r"holds no ACD release, SCAPE set.*https://github\.com/Wang-Chen9"):
        unpack(tmp_path / "in", tmp_path / "out", [RELEASE], progress=False)
    assert not (tmp_path / "out").exists()


def test_the_source_is_never_written_to(tmp_path):
    shapes = recognise(layouts.shrec19(tmp_path))
    for target in (tmp_path, tmp_path / "inside"):
        with pytest.raises(DataError, match="choose another place"):
            lay_out(shapes, target)


def test_script_fills_the_store_once(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "cache"))
    layouts.sga18(tmp_path / "in", ("cat0", "cat1", "cat2"))
    for name in ("cat1", "cat2"):
        (tmp_path / "in" / "vtx_5k" / "corres" / f"{name}.vts").unlink()
    write_mesh(tmp_path / "in" / "vtx_5k" / "cat0.off", blob(3))
    arguments = [str(tmp_path / "in"), "--out", str(tmp_path / "out"), "--store"]
    assert script("A title.", [SGA18], arguments) == 0
    assert "1 prepared, 0 already" in capsys.readouterr().out
    assert script("A title.", [SGA18], arguments) == 0
    assert "0 prepared, 1 already" in capsys.readouterr().out


def test_script_status_tells_unusable_shapes_from_errors(tmp_path, capsys):
    layouts.sga18(tmp_path / "in")
    (tmp_path / "in" / "vtx_5k" / "cat0.off").write_text("nonsense")
    assert script("A title.", [SGA18], [str(tmp_path / "in"), "--out", str(tmp_path / "out")]) == 1
    assert "cat0.off" in capsys.readouterr().out
    assert script("A title.", [SGA18], [str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")]) == 2
    assert "no such file" in capsys.readouterr().err


def test_unpacking_twice_gives_the_same(tmp_path):
    layouts.sga18(tmp_path / "in")
    unpack(tmp_path / "in", tmp_path / "out", [SGA18], progress=False)
    first = contents(tmp_path / "out")
    unpack(tmp_path / "in", tmp_path / "out", [SGA18], progress=False)
    assert contents(tmp_path / "out") == first
    shutil.rmtree(tmp_path / "in")
    assert recognise(tmp_path / "out" / "TOSCA_5k_remeshed").load("cat0").truth.n_from == 30


def test_an_edited_file_is_not_overwritten_without_a_word(tmp_path, capsys):
    layouts.sga18(tmp_path / "in")
    unpack(tmp_path / "in", tmp_path / "out", [SGA18], progress=False)
    root = tmp_path / "out" / "TOSCA_5k_remeshed"
    first = contents(root)
    (root / "vtx_5k" / "corres" / "dog0.vts").unlink()
    edited = root / "vtx_5k" / "cat0.off"
    write_mesh(edited, blob(1))
    mine = edited.read_bytes()
    arguments = [str(tmp_path / "in"), "--out", str(tmp_path / "out")]
    assert script("A title.", [SGA18], arguments) == 2
    said = capsys.readouterr().err
    assert "1 of 10 files are there already and differ from the source's (vtx_5k/cat0.off)" in said
    assert "--overwrite" in said
    assert edited.read_bytes() == mine
    assert not (root / "vtx_5k" / "corres" / "dog0.vts").exists()
    assert script("A title.", [SGA18], [*arguments, "--overwrite"]) == 0
    assert contents(root) == first


def test_files_that_are_the_same_are_not_written_again(tmp_path):
    layouts.sga18(tmp_path / "in")
    unpack(tmp_path / "in", tmp_path / "out", [SGA18], progress=False)
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.off")}
    unpack(tmp_path / "in", tmp_path / "out", [SGA18], progress=False, overwrite=True)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.off")} == times


def test_an_out_that_is_a_file_is_one_sentence(tmp_path, capsys):
    layouts.sga18(tmp_path / "in")
    (tmp_path / "file").write_text("mine")
    assert script("A title.", [SGA18], [str(tmp_path / "in"), "--out", str(tmp_path / "file")]) == 2
    assert str(tmp_path / "file") in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("offset", [8, 6])
def test_an_archive_of_unknown_packing_is_one_sentence(tmp_path, capsys, offset):
    """The first member's compression method, or its flag for encryption, is another."""
    layouts.sga18(tmp_path / "in")
    with zipfile.ZipFile(tmp_path / "set.zip", "w") as archive:
        for path in sorted((tmp_path / "in").rglob("*.off")):
            archive.write(path, path.relative_to(tmp_path))
    content = bytearray((tmp_path / "set.zip").read_bytes())
    content[content.index(b"PK\x01\x02") + offset + 2] = 97
    (tmp_path / "set.zip").write_bytes(content)
    assert script("A title.", [SGA18], [str(tmp_path / "set.zip"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "set.zip: its member in/vtx_5k/cat0.off is " in said
    assert said.count("\n") == 1


def _unpack(source, out) -> None:
    unpack(source, out, [SGA18], progress=False)


def test_two_scripts_at_once_do_no_harm(tmp_path):
    layouts.sga18(tmp_path / "in")
    context = multiprocessing.get_context("fork")
    both = [context.Process(target=_unpack, args=(tmp_path / "in", tmp_path / "out")) for _ in range(2)]
    for process in both:
        process.start()
    for process in both:
        process.join(60)
    assert [process.exitcode for process in both] == [0, 0]
    _unpack(tmp_path / "in", tmp_path / "alone")
    name = "TOSCA_5k_remeshed"
    assert contents(tmp_path / "out" / name) == contents(tmp_path / "alone" / name)


def test_a_stopped_script_says_how_to_go_on(tmp_path, capsys, monkeypatch):
    layouts.sga18(tmp_path / "in")

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("csm.data.unpacking.inspect", stopped)
    assert script("A title.", [SGA18], [str(tmp_path / "in"), "--out", str(tmp_path / "out")]) == 130
    assert "stopped: run the same command again" in capsys.readouterr().err
