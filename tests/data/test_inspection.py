import numpy as np
import pytest

from csm.data.folder import FolderDataModule
from csm.data.humans import HumansDataModule
from csm.data.inspection import data_problems, inspect, require_sound
from csm.data.registry import recognise
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import DataError
from csm.mesh.io import read_mesh, write_map, write_mesh
from csm.mesh.shape import Mesh
from tests.data import layouts
from tests.shapes import sphere
from tests.toyset import toy_datamodule, write_toys


def module(root, **options) -> FolderDataModule:
    return FolderDataModule(root, descriptor=HKS(k=6, n_times=3), basis_k=8, workers=0, **options)


@pytest.fixture
def toys(tmp_path):
    return write_toys(tmp_path / "toys")


def kinds(data, **options) -> list[tuple[str, str, str]]:
    return [(p.shape, p.kind, p.severity) for p in data_problems(data, progress=False, **options)]


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
    write_mesh(tmp_path / "a.off", Mesh(np.where(np.arange(42)[:, None] == 3, np.nan, ball.vertices), ball.faces))
    write_mesh(tmp_path / "b.off", Mesh(ball.vertices, ball.faces[1:]))
    write_map(tmp_path / "corres" / "a.vts", np.array([1]))
    a, b = inspect(recognise(tmp_path), progress=False)
    assert not a.usable
    assert b.usable  # a boundary is a note, and a map that is not there is the set's matter
    assert [f.kind for f in b.findings] == ["boundary"]


def test_a_map_that_is_shorter_than_the_others_is_named(tmp_path):
    for name, n in (("a", 42), ("b", 42), ("c", 30)):
        write_mesh(tmp_path / f"{name}.off", sphere(1))
        write_map(tmp_path / "corres" / f"{name}.vts", np.arange(n))
    rows = inspect(recognise(tmp_path), progress=False)
    assert [row.usable for row in rows] == [True, True, False]
    assert [row.n_truth for row in rows] == [42, 42, 30]
    (text,) = rows[2].problems
    assert str(tmp_path / "corres" / "c.vts") in text
    assert "tells of 30 template points, but the other maps of" in text
    with pytest.raises(DataError, match=r"c\.vts: tells of 30"):
        require_sound(module(tmp_path), progress=False)


def test_maps_of_different_templates_may_differ_in_length(tmp_path):
    layouts.sga18(tmp_path)
    write_map(tmp_path / "vtx_5k" / "corres" / "dog0.vts", np.arange(20))
    assert all(row.usable for row in inspect(recognise(tmp_path), progress=False))


def test_one_bad_file_is_not_blamed_on_the_others(toys):
    (toys / "toy0.off").write_text("nonsense")
    assert [row.usable for row in inspect(recognise(toys), progress=False)] == [False] + [True] * 5


def test_a_good_set_with_all_defaults_has_no_problem(toys):
    assert kinds(module(toys)) == []
    require_sound(module(toys), exact=True, progress=False)


@pytest.mark.parametrize("bad", ["toy1", "toy5"])
def test_a_shape_that_cannot_be_used_is_found_wherever_it_is(toys, bad):
    mesh = read_mesh(toys / f"{bad}.off")
    text = (toys / f"{bad}.off").read_text().splitlines()
    text[5] = "nan 0 0"
    (toys / f"{bad}.off").write_text("\n".join(text))
    assert kinds(module(toys)) == [(bad, "non_finite", "error")]
    with pytest.raises(DataError, match=rf"{bad}\.off: vertices with coordinates that are not finite: 1"):
        require_sound(module(toys), progress=False)
    (toys / f"{bad}.off").write_text("nonsense")
    assert kinds(module(toys)) == [(bad, "unreadable", "error")]
    write_mesh(toys / f"{bad}.off", Mesh(mesh.vertices, mesh.faces[::-1]))
    assert kinds(module(toys)) == [(bad, "unreadable", "error")]


def test_the_test_shapes_count_only_if_there_is_a_test(toys):
    (toys / "toy5.off").write_text("nonsense")
    assert kinds(module(toys), test=False) == []
    assert kinds(module(toys, n_test=1)) == [("toy5", "unreadable", "error"), ("", "no_pairs", "error")]


def test_where_exact_distances_cannot_be_measured_is_said(toys):
    """A fin: a triangle more on an edge that has two already, the same on all shapes."""
    for path in toys.glob("*.off"):
        mesh = read_mesh(path)
        tip = mesh.vertices[mesh.faces[0, 0]] * 1.3
        fin = [*mesh.faces[0, :2], mesh.n_vertices]
        write_mesh(path, Mesh(np.vstack([mesh.vertices, [tip]]), np.vstack([mesh.faces, [fin]])))
    assert {(kind, severity) for _, kind, severity in kinds(module(toys))} == {("not_exact", "note")}
    require_sound(module(toys), progress=False)
    require_sound(module(toys), exact=True, test=False, progress=False)
    with pytest.raises(DataError, match="exact geodesic distances cannot be measured on such a mesh"):
        require_sound(module(toys), exact=True, progress=False)


def test_what_a_split_leaves_is_told_before_the_training(toys):
    assert kinds(module(toys, n_test=1)) == [("", "no_pairs", "error")]
    assert kinds(module(toys, n_test=1), test=False) == []
    with pytest.raises(DataError, match=r"toys: split toys leaves 1 test shape .* make a pair .*data\.n_test=2"):
        require_sound(module(toys, n_test=1), progress=False)
    missing = Split("mine", ("toy0", "toy1"), ("toy2", "toy9"))
    assert kinds(module(toys, split=missing)) == [("", "missing", "error"), ("", "no_pairs", "error")]
    several = Split("mine", ("toy0", "toy9"), ("toy2", "toy3"))
    assert kinds(module(toys, split=several)) == [("", "missing", "error")]


def test_a_shape_with_fewer_vertices_than_eigenpairs_is_named_before_the_work(tmp_path):
    data = toy_datamodule(tmp_path, basis_k=163)
    found = data_problems(data, progress=False)
    assert {problem.kind for problem in found} == {"too_small"}
    assert len(found) == 6
    assert "has 162 vertices, but 163 eigenpairs are asked for" in str(found[0])


def test_a_form_of_the_built_in_humans_that_cannot_be_is_found_at_the_first_of_them(tmp_path):
    options = {"descriptor": HKS(k=6, n_times=3), "basis_k": 8, "workers": 0, "store": Store(tmp_path)}
    with pytest.raises(DataError, match="cannot refine 6899 vertices to 100"):
        require_sound(HumansDataModule(test=["original"], test_forms=["refined_100"], **options))
    require_sound(HumansDataModule(test=["original"], test_forms=["slivers_10"], **options))
