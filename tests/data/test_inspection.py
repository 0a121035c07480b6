import numpy as np

from csm.data.inspection import inspect
from csm.data.registry import recognise
from csm.mesh.io import write_map, write_mesh
from csm.mesh.shape import Mesh
from tests.data import layouts
from tests.shapes import sphere


def test_every_shape_has_a_row_and_bad_ones_do_not_stop_it(tmp_path):
    layouts.sga18(tmp_path)
    (tmp_path / "vtx_5k" / "cat0.off").write_text("nonsense")
    write_map(tmp_path / "vtx_5k" / "corres" / "dog0.vts", np.array([99]))
    rows = {row.name: row for row in inspect(recognise(tmp_path), progress=False)}
    assert list(rows) == ["cat0", "cat10", "dog0"]
    assert [row.usable for row in rows.values()] == [False, True, False]
    assert "cat0.off" in rows["cat0"].problems[0]
    assert "dog0.vts" in rows["dog0"].problems[0]
    assert (rows["cat10"].n_vertices, rows["cat10"].n_faces) == (42, 80)
    assert rows["cat10"].area == recognise(tmp_path).mesh("cat10").area


def test_findings_decide_about_use(tmp_path):
    ball = sphere(1)
    write_mesh(tmp_path / "a.off", Mesh(np.concatenate([ball.vertices, [[9, 9, 9]]]), ball.faces))
    write_mesh(tmp_path / "b.off", Mesh(ball.vertices, ball.faces[1:]))
    write_map(tmp_path / "corres" / "a.vts", np.array([1]))
    a, b = inspect(recognise(tmp_path), progress=False)
    assert not a.usable
    assert b.usable  # a boundary is a note, and a map that is not there is the set's matter
    assert [f.kind for f in b.findings] == ["boundary"]
