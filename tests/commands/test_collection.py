from __future__ import annotations

import json
import os

import pytest

from csm.mesh.io import write_mesh
from tests.matching.collection.copies import copies
from tests.shapes import blob

SMALL = ("descriptor=wks", "descriptor.k=30", "workers=0")


def test_a_folder_is_matched_and_matched_again(csm, tmp_path):
    (tmp_path / "in").mkdir()
    for mesh in copies(3):
        write_mesh(tmp_path / "in" / f"{mesh.name}.off", mesh)
    status, out, _ = csm("match", "folder=in", "out=r", "pairs=reference", *SMALL)
    assert status == 0
    account = json.loads((tmp_path / "r/collection.json").read_text())
    assert "3 shapes matched by the descriptor WKS" in out
    assert "r: 4 maps in maps/" in out
    assert len(os.listdir(tmp_path / "r/maps")) == 4
    assert account["seconds"] > 0
    assert {shape["file"] for shape in account["shapes"]} == {f"in/s{i}.off" for i in range(3)}
    assert csm("match", "folder=in", "out=r", "pairs=all", *SMALL)[0] == 0
    assert len(os.listdir(tmp_path / "r/maps")) == 6
    (tmp_path / "r/maps/s0_to_s1.txt").write_text("mine")
    status, _, error = csm("match", "folder=in", "out=r", *SMALL)
    assert status == 2
    assert "r/maps/s0_to_s1.txt: there is such a file, which has been changed since csm wrote it" in error


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["folder=in", "source=a.off"], "folder=in together with source=a.off: wanted either two meshes"),
        (["a.off", "a.off", "folder=in"], "folder=in together with source=a.off target=a.off"),
        (["folder=gone"], "gone: there is no such folder; wanted one with two or more meshes"),
        (["folder=in"], "in: has 1 mesh file, wanted two or more"),
        (["folder=in", "pairs=some"], "pairs=some: wanted auto, all or reference"),
    ],
)
def test_what_cannot_be_is_said_before_any_work(csm, tmp_path, words, said):
    (tmp_path / "in").mkdir()
    write_mesh(tmp_path / "in/a.off", blob(2))
    write_mesh(tmp_path / "a.off", blob(2))
    status, _, error = csm("match", *words)
    assert status == 2
    assert said in error
    assert not (tmp_path / "in_matched").exists()


def test_the_inputs_are_never_replaced(csm, tmp_path):
    (tmp_path / "out/shapes").mkdir(parents=True)
    for name in ("a", "b"):
        write_mesh(tmp_path / "out/shapes" / f"{name}.ply", blob(2))
    before = {path: path.read_bytes() for path in (tmp_path / "out/shapes").iterdir()}
    status, _, error = csm("match", "folder=out/shapes", "out=out", "overwrite=true")
    assert status == 2
    assert "which would be replaced" in error
    assert {path: path.read_bytes() for path in (tmp_path / "out/shapes").iterdir()} == before


def test_the_help_tells_of_folders(csm):
    _, out, _ = csm("match", "--help")
    assert "folder=null" in out
    assert "pairs=auto" in out


@pytest.mark.parametrize("words", [["folder=in", "descriptor=gps"], ["in/s0.off", "in/s1.off", "descriptor=gps"]])
def test_a_stopped_match_says_that_nothing_is_written(csm, tmp_path, monkeypatch, words):
    (tmp_path / "in").mkdir()
    for mesh in copies(2):
        write_mesh(tmp_path / "in" / f"{mesh.name}.off", mesh)

    def stop(*args, **options):
        raise KeyboardInterrupt

    for place in ("csm.commands.match.match_meshes", "csm.commands.collection.match_collection"):
        monkeypatch.setattr(place, stop)
    status, _, error = csm("match", *words, "out=r")
    assert status == 130
    assert error.startswith("csm: stopped: the result is not written; the same command begins again")
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize("words", [["describe", "a.off", "d.npz"], ["clean", "a.off", "b.off"]])
def test_a_stopped_command_without_a_store_says_that_it_begins_again(csm, tmp_path, monkeypatch, words):
    write_mesh(tmp_path / "a.off", blob(2))

    def stop(*args, **options):
        raise KeyboardInterrupt

    for place in ("csm.commands.describe.subject_of", "csm.commands.clean.clean"):
        monkeypatch.setattr(place, stop)
    status, _, error = csm(*words)
    assert (status, error) == (130, "csm: stopped: the result is not written; the same command begins again\n")
