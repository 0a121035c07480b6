import numpy as np
import pytest

from csm.commands.check import check_folder
from csm.mesh.io import write_mesh
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
    assert "1 files are missing" in str(report)
    assert "vtx_5k/corres/cat10.sym.vts" in str(report)
    assert "https://github.com/llorz" in str(report)
    assert report.n_unusable == 0


def test_errors_and_notes_stand_in_the_row(tmp_path):
    ball = sphere(1)
    write_mesh(tmp_path / "a.off", Mesh(np.concatenate([ball.vertices, [[9, 9, 9]]]), ball.faces[1:]))
    (tmp_path / "b.off").write_text("nonsense")
    report = check_folder(tmp_path, progress=False)
    a, b = str(report).splitlines()[1:3]
    assert "ERROR vertices in no face: 1 (42)" in a
    assert "boundary edges: 3" in a
    assert "ERROR" in b
    assert "b.off" in b
    assert report.n_unusable == 2


@pytest.mark.data
def test_a_real_set(data_set):
    report = check_folder(data_set("SHREC19_5k_remeshed"), progress=False)
    text = str(report)
    assert report.n_unusable == 0
    assert "44 shapes, 37 with correspondence" in text
    assert "430 test pairs, 310 with both maps" in text
    row = next(line for line in text.splitlines() if line.startswith("40 "))
    assert "boundary edges: 350" in row
