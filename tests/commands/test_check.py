import json
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from csm.commands.check import check_folder, run
from csm.data.registry import layouts as known_layouts
from csm.data.registry import recognise
from csm.errors import DataError
from csm.matching.collection.shapes import mesh_files
from csm.mesh.io import file_digest, write_mesh
from csm.mesh.shape import Mesh
from tests.data import layouts
from tests.shapes import sphere


def test_table_has_a_row_per_shape_then_kind_and_what_is_missing(tmp_path):
    layouts.sga18(tmp_path)
    (tmp_path / "vtx_5k" / "corres" / "cat10.sym.vts").unlink()
    report = check_folder(tmp_path, progress=False)
    lines = str(report).splitlines()
    assert lines[0].split() == ["shape", "vertices", "faces", "area", "findings"]
    assert [line.split()[0] for line in lines[1:4]] == ["cat0", "cat10", "dog0"]
    assert lines[1].split()[1:3] == ["42", "80"]
    assert "SGA18/BCICP remeshed TOSCA" in str(report)
    assert "1 file is missing" in str(report)
    assert "vtx_5k/corres/cat10.sym.vts" in str(report)
    assert "https://github.com/llorz" in str(report)
    assert report.n_unusable == 0


def test_errors_and_notes_stand_in_the_row(tmp_path):
    ball = sphere(1)
    write_mesh(tmp_path / "a.off", Mesh(np.concatenate([ball.vertices, [[9, 9, 9]]]), ball.faces[1:]))
    (tmp_path / "b.off").write_text("nonsense")
    report = check_folder(tmp_path, progress=False)
    a, b = str(report).splitlines()[1:3]
    assert "; vertices in no face: 1 (42)" in a or a.split()[4] == "vertices"
    assert "boundary edges: 3" in a
    assert "ERROR" in b
    assert "b.off" in b
    assert report.n_unusable == 1


CASES = Path(__file__).parent.parent / "cases"


def checked(capsys, *paths, use=None, folder=None):
    """Run the command; return what it printed, and the message of its error."""
    error = ""
    try:
        run(OmegaConf.create({"paths": [str(path) for path in paths], "folder": folder, "use": use}))
    except DataError as raised:
        error = str(raised)
    return capsys.readouterr().out, error


def test_files_are_checked_as_meshes_to_match(capsys):
    out, error = checked(capsys, CASES / "spot_half.off", CASES / "spot_inside_out.off")
    assert error == ""
    assert "boundary edges: 54" in out
    assert "csm match cleans it: 1654 faces turned" in out
    assert "2 meshes, 2 can be matched" in out
    out, error = checked(capsys, CASES / "spot_half.off", CASES / "damaged/ragged.ply")
    assert "ERROR" in out
    assert "1 of 2 meshes cannot be used" in error


def test_an_empty_folder_is_answered_with_where_sets_are_published(tmp_path, capsys):
    out, error = checked(capsys, tmp_path)
    assert "no meshes that csm can read" in error
    assert "  MPI-FAUST\n      MPI-FAUST.zip" in out
    assert "https://" in out


def test_the_sets_that_are_published_stand_one_below_the_other_with_their_places(tmp_path, capsys):
    out, _ = checked(capsys, tmp_path, use="train")
    lines = out.splitlines()
    for layout in known_layouts()[:-1]:
        at = lines.index(f"  {layout.title}")
        assert layout.origin.startswith(lines[at + 1].strip())
        assert lines[at + 1].startswith("      ")
    assert "  plain folder" not in lines


def test_every_argument_gets_its_answer(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    write_mesh(tmp_path / "full" / "a.off", sphere(1))
    write_mesh(tmp_path / "full" / "b.off", sphere(2))
    out, error = checked(capsys, tmp_path / "gone.off", tmp_path / "empty", tmp_path / "full")
    assert "gone.off: there is no such file" in out
    assert "empty: there are no meshes in this folder" in out
    assert "2 meshes, 2 can be matched" in out
    assert error == "1 file or folder is not there and 1 folder has no meshes, see the table"
    assert "empty: there are no meshes in this folder" in checked(capsys, tmp_path / "empty", use="match")[1]
    out, error = checked(capsys, tmp_path / "empty", tmp_path / "full" / "a.off")
    assert error == "1 folder has no meshes, see the table"


def test_what_a_match_has_written_is_left_out_as_the_match_of_the_folder_does(tmp_path, capsys):
    for n in (1, 2):
        write_mesh(tmp_path / f"{n}.off", sphere(2))
    write_mesh(tmp_path / "reference.ply", sphere(1))
    digest = file_digest(tmp_path / "reference.ply")
    (tmp_path / "collection.json").write_text(json.dumps({"files": {"reference.ply": digest}}))
    said = f"{tmp_path}: left out reference.ply, which csm match has written there"
    out, error = checked(capsys, tmp_path)
    assert error == ""
    assert said in out
    assert "2 shapes, 2 with correspondence" in out
    np.savez(tmp_path / "d.npz", values=np.zeros(3))
    out, _ = checked(capsys, tmp_path, use="match")
    assert f"{said}, and d.npz, which may be no mesh" in out
    assert "2 meshes, 2 can be matched" in out
    assert len(mesh_files(tmp_path)) == len(recognise(tmp_path).names) == 2


def test_a_folder_of_unlike_meshes_needs_no_correspondence_to_be_matched(tmp_path, capsys):
    for n in (1, 2, 3):
        write_mesh(tmp_path / f"{n}.off", sphere(n))
    out, error = checked(capsys, tmp_path)
    assert error == ""
    assert "checked as one to match" in out
    assert "3 of 3" not in out
    assert "the correspondence of this shape is not known" in checked(capsys, tmp_path, use="train")[0]
    assert "3 meshes, 3 can be matched" in checked(capsys, folder=str(tmp_path), use="match")[0]
    write_mesh(tmp_path / "1.ply", sphere(1))
    out, error = checked(capsys, tmp_path)
    assert "have one name" in out
    assert "4 meshes, 4 can be matched" in out


@pytest.mark.data
def test_a_real_set(data_set):
    report = check_folder(data_set("SHREC19_5k_remeshed"), progress=False)
    text = str(report)
    assert report.n_unusable == 0
    assert "44 shapes, 37 with correspondence" in text
    assert "430 test pairs, 310 with both maps" in text
    row = next(line for line in text.splitlines() if line.startswith("40 "))
    assert "boundary edges: 350" in row


def test_a_folder_of_sets_is_answered_with_the_sets(tmp_path, capsys):
    layouts.sga18(tmp_path / "TOSCA")
    layouts.mpi_faust(tmp_path / "deep" / "FAUST")
    out, error = checked(capsys, tmp_path)
    assert error == ""
    assert f"TOSCA_5k_remeshed: 3 shapes (SGA18/BCICP remeshed TOSCA) in {tmp_path / 'TOSCA'}" in out
    assert "2 sets; csm check" in out
    out, error = checked(capsys, tmp_path, use="train")
    assert "did you mean" in error
