import pickle
import shutil

import numpy as np
import pytest

from csm.data.folder import find_sets, recognise
from csm.data.kinds import ACD_FAUST, ACD_SCAPE, LPS, MPI_FAUST, PLAIN, SGA18_FAUST, SGA18_TOSCA, SHREC19
from csm.data.shapeset import ShapeSet
from csm.errors import CsmError, DataError
from csm.mesh.correspondence import ground_truth
from csm.mesh.io import write_map, write_mesh
from csm.mesh.shape import Mesh
from tests.data import layouts
from tests.shapes import blob, sphere


def missing(shapes):
    return [m.path for m in shapes.missing]


@pytest.mark.parametrize("below", ["", "MPI-FAUST", "MPI-FAUST/training", "MPI-FAUST/training/registrations"])
def test_mpi_faust_from_any_of_its_folders(tmp_path, below):
    shapes = recognise(layouts.mpi_faust(tmp_path) / below)
    assert shapes.kind is MPI_FAUST
    assert shapes.names == ("tr_reg_000", "tr_reg_001")
    assert len(missing(shapes)) == 98
    assert missing(shapes)[0].endswith("tr_reg_002.ply")
    assert "registration" in shapes.missing[0].origin
    assert "http://faust.is.tue.mpg.de" in shapes.missing[0].origin
    shape = shapes.load("tr_reg_001")
    np.testing.assert_array_equal(shape.truth.indices, np.arange(6890))


def test_mpi_faust_with_scans_only_is_known_and_empty(tmp_path):
    write_mesh(tmp_path / "training" / "scans" / "tr_scan_000.ply", sphere(1))
    shapes = recognise(tmp_path)
    assert shapes.kind is MPI_FAUST
    assert shapes.names == ()
    assert missing(shapes)[99] == "training/registrations/tr_reg_099.ply"


def test_a_decimated_registration_is_refused(tmp_path):
    write_mesh(tmp_path / "tr_reg_000.ply", sphere(2))
    with pytest.raises(DataError, match=r"tr_reg_000\.ply: has 162 vertices.*first 6890"):
        recognise(tmp_path).load("tr_reg_000")


def test_acd_release_of_scape(tmp_path):
    shapes = recognise(layouts.acd(tmp_path))
    assert shapes.kind is ACD_SCAPE
    assert shapes.lists == {"train": ("mesh000",), "test": ("mesh052",)}
    assert len(missing(shapes)) == 2 * 69
    assert "shapes/mesh051.mat" not in missing(shapes)
    truth = shapes.load("mesh000").truth
    assert (truth.n_from, truth.n_to) == (50, 42)
    assert len(set(truth.indices.tolist())) < 50  # classes share vertices


def test_acd_release_of_faust_names_missing_labels(tmp_path):
    layouts.acd(tmp_path, ("tr_reg_000", "tr_reg_001"))
    (tmp_path / "labels" / "tr_reg_001.mat").unlink()
    shapes = recognise(tmp_path)
    assert shapes.kind is ACD_FAUST
    assert shapes.mapped == ("tr_reg_000",)
    assert "labels/tr_reg_001.mat" in missing(shapes)
    with pytest.raises(DataError, match=r"tr_reg_001\.mat.*its map is missing"):
        shapes.load("tr_reg_001")
    assert shapes.mesh("tr_reg_001").n_vertices == 42


@pytest.mark.parametrize("n", [8000, 10000, 12000, 15000])
def test_lps(tmp_path, n):
    shapes = recognise(layouts.lps(tmp_path, n=n))
    assert (shapes.kind, shapes.name) == (LPS, f"FAUST_{n}")
    truth = shapes.load("tr_reg_081").truth
    assert (truth.n_from, truth.n_to) == (6890, n)
    np.testing.assert_array_equal(truth.indices, np.arange(6890))
    assert len(missing(shapes)) == 98


def test_other_sizes_of_faust_are_no_lps_data(tmp_path):
    assert recognise(layouts.lps(tmp_path, n=9000)).kind is PLAIN


@pytest.mark.parametrize("below", ["", "vtx_5k"])
def test_sga18_tosca_has_a_template_per_class(tmp_path, below):
    shapes = recognise(layouts.sga18(tmp_path) / below)
    assert shapes.kind is SGA18_TOSCA
    assert shapes.names == ("cat0", "cat10", "dog0")
    assert [e.template for e in shapes.entries] == ["cat", "cat", "dog"]
    assert shapes.pairs == (("cat0", "cat10"), ("cat0", "dog0"))
    assert shapes.mapped_pairs == (("cat0", "cat10"),)
    assert shapes.missing == ()
    shape = shapes.load("cat10")
    assert shape.truth.indices.tolist() == list(range(30))
    assert shape.mirror.indices.tolist() == list(range(30))[::-1]


def test_sga18_faust_names_what_is_missing(tmp_path):
    layouts.sga18(tmp_path, ("tr_reg_000", "tr_reg_001", "tr_reg_002"))
    (tmp_path / "vtx_5k" / "corres" / "tr_reg_001.sym.vts").unlink()
    (tmp_path / "test_pairs.txt").unlink()
    shapes = recognise(tmp_path)
    assert shapes.kind is SGA18_FAUST
    for path in ("vtx_5k/tr_reg_003.off", "vtx_5k/corres/tr_reg_001.sym.vts", "test_pairs.txt"):
        assert path in missing(shapes)
    assert shapes.load("tr_reg_001").mirror is None


def test_shapes_that_pairs_name_are_missed(tmp_path):
    layouts.sga18(tmp_path)
    (tmp_path / "vtx_5k" / "cat10.off").unlink()
    shapes = recognise(tmp_path)
    assert "vtx_5k/cat10.off" in missing(shapes)
    assert shapes.mapped_pairs == ()


def test_shrec19(tmp_path):
    shapes = recognise(layouts.shrec19(tmp_path))
    assert shapes.kind is SHREC19
    assert shapes.names == ("1", "2", "10")
    assert shapes.mapped == ("1", "10")
    assert shapes.mapped_pairs == (("1", "10"),)
    assert "derived_smpl_vts/2.vts" in missing(shapes)
    assert "44.obj" in missing(shapes)


def test_plain_folder_of_one_connectivity(tmp_path):
    ball = sphere(1)
    for name, scale in (("a", 1.0), ("b2", 2.0), ("b10", 3.0)):
        write_mesh(tmp_path / f"{name}.ply", Mesh(ball.vertices * scale, ball.faces))
    shapes = recognise(tmp_path)
    assert (shapes.kind, shapes.name) == (PLAIN, tmp_path.name)
    assert shapes.names == ("a", "b2", "b10")
    assert len(ground_truth(shapes.load("a").truth, shapes.load("b10").truth)) == ball.n_vertices


def test_plain_folder_of_several_connectivities_has_no_map(tmp_path):
    write_mesh(tmp_path / "a.off", sphere(1))
    write_mesh(tmp_path / "b.off", Mesh(sphere(1).vertices, sphere(1).faces[::-1]))
    shapes = recognise(tmp_path)
    assert shapes.load("a").truth.n_known == 42
    with pytest.raises(DataError, match=r"b\.off.*triangles differ.*corres/b\.vts"):
        shapes.load("b")


@pytest.mark.parametrize("place", ["", "off"])
def test_plain_folder_with_maps(tmp_path, place):
    write_mesh(tmp_path / place / "a.off", sphere(1))
    write_mesh(tmp_path / place / "b.off", blob(2))
    write_map(tmp_path / "corres" / "a.vts", np.array([3, 1]))
    write_map(tmp_path / "corres" / "a.sym.vts", np.array([1, 3]))
    shapes = recognise(tmp_path)
    assert shapes.mapped == ("a",)
    assert shapes.load("a").mirror.indices.tolist() == [1, 3]
    assert missing(shapes) == ["corres/b.vts"]


def test_two_files_of_one_name_are_refused(tmp_path):
    write_mesh(tmp_path / "a.off", sphere(1))
    write_mesh(tmp_path / "a.ply", sphere(1))
    with pytest.raises(DataError, match="one name"):
        recognise(tmp_path)


def test_folders_without_meshes_say_where_they_are(tmp_path):
    layouts.sga18(tmp_path / "FAUST_5k")
    layouts.shrec19(tmp_path / "shrec")
    with pytest.raises(DataError, match=r"did you mean .*FAUST_5k, .*shrec"):
        recognise(tmp_path)
    with pytest.raises(DataError, match="no meshes that csm can read; wanted one of: MPI-FAUST"):
        recognise(tmp_path / "nowhere")


def test_sets_are_found_below_a_download(tmp_path):
    layouts.acd(tmp_path / "repository-main" / "CSMCNN" / "datasets" / "SCAPE")
    layouts.sga18(tmp_path / "repository-main" / "Dataset" / "TOSCA")
    assert sorted(s.kind.key for s in find_sets(tmp_path)) == ["acd_scape", "sga18_tosca"]


def test_an_unknown_shape_is_named(tmp_path):
    with pytest.raises(DataError, match=r"no shape 'cow' among the 3"):
        recognise(layouts.sga18(tmp_path)).load("cow")


def test_nothing_is_read_before_it_is_asked_for(tmp_path):
    layouts.sga18(tmp_path)
    (tmp_path / "vtx_5k" / "cat0.off").write_text("nonsense")
    shapes = recognise(tmp_path)
    assert shapes.load("cat10").mesh.n_vertices == 42
    with pytest.raises(CsmError, match=r"cat0\.off"):
        shapes.load("cat0")


def test_a_set_serves_data_modules_and_their_worker_processes(tmp_path):
    shapes: ShapeSet = recognise(layouts.acd(tmp_path))
    copy = pickle.loads(pickle.dumps(shapes))
    assert copy.names == shapes.names
    assert copy.load("mesh000").mesh.digest == shapes.load("mesh000").mesh.digest


def test_the_folder_is_not_changed(tmp_path):
    layouts.sga18(tmp_path / "a")
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    shapes = recognise(tmp_path / "a")
    for name in shapes.names:
        shapes.load(name)
    before = {p.relative_to(tmp_path / "b"): p.read_bytes() for p in (tmp_path / "b").rglob("*") if p.is_file()}
    after = {p.relative_to(tmp_path / "a"): p.read_bytes() for p in (tmp_path / "a").rglob("*") if p.is_file()}
    assert before == after


REAL = {
    "FAUST_6890": (ACD_FAUST, 100, 100, 0, 0, 0, 6890),
    "FAUST_10000": (LPS, 20, 20, 0, 0, 80, 6890),
    "FAUST_15000": (LPS, 20, 20, 0, 0, 80, 6890),
    "FAUST_5k_remeshed": (SGA18_FAUST, 100, 100, 300, 300, 0, 5000),
    "TOSCA_5k_remeshed": (SGA18_TOSCA, 76, 76, 284, 284, 0, 5000),
    "SCAPE_5000": (ACD_SCAPE, 71, 71, 0, 0, 0, 5000),
    "SHREC19_5k_remeshed": (SHREC19, 44, 37, 430, 310, 7, 6890),
}


@pytest.mark.data
@pytest.mark.parametrize("name", REAL)
def test_real_sets(data_set, name):
    kind, n_shapes, n_mapped, n_pairs, n_mapped_pairs, n_missing, n_template = REAL[name]
    shapes = recognise(data_set(name))
    assert (shapes.kind, shapes.name) == (kind, name)
    counts = (len(shapes.names), len(shapes.mapped), len(shapes.pairs), len(shapes.mapped_pairs), len(shapes.missing))
    assert counts == (n_shapes, n_mapped, n_pairs, n_mapped_pairs, n_missing)
    first, last = shapes.load(shapes.mapped[0]), shapes.load(shapes.mapped[-1])
    assert first.truth.n_from == n_template
    if shapes.entry(first.name).template == shapes.entry(last.name).template:
        assert len(ground_truth(first.truth, last.truth)) == n_template
    assert (first.mirror is not None) == (kind in (SGA18_FAUST, SGA18_TOSCA))


@pytest.mark.data
def test_real_scape_has_no_mesh051_and_the_lists_cover_all(data_set):
    shapes = recognise(data_set("SCAPE_5000"))
    assert "mesh051" not in shapes.names
    assert {k: len(v) for k, v in shapes.lists.items()} == {"train": 51, "test": 20}
    assert sorted(shapes.lists["train"] + shapes.lists["test"]) == sorted(shapes.names)


@pytest.mark.data
def test_real_remeshed_faust_has_a_hundred_pairs_of_the_same_person(data_set):
    pairs = recognise(data_set("FAUST_5k_remeshed")).pairs
    assert sum(int(a[-3:]) // 10 == int(b[-3:]) // 10 for a, b in pairs) == 100


@pytest.mark.data
def test_real_maps_go_from_template_to_shape(data_set):
    """Neighbouring template points must be neighbours on the shape: true only for the right direction and base."""
    faust = recognise(data_set("FAUST_6890")).mesh("tr_reg_000")
    shape = recognise(data_set("SHREC19_5k_remeshed")).load("1")
    size = np.sqrt(shape.mesh.area)
    on_shape = shape.mesh.vertices[shape.truth.indices]
    edge = np.linalg.norm(on_shape[faust.faces[:, 0]] - on_shape[faust.faces[:, 1]], axis=1)
    assert np.percentile(edge, 99) < 0.1 * size
    shifted = shape.mesh.vertices[(shape.truth.indices + 1) % shape.mesh.n_vertices]
    edge = np.linalg.norm(shifted[faust.faces[:, 0]] - shifted[faust.faces[:, 1]], axis=1)
    assert np.percentile(edge, 99) > 0.3 * size


@pytest.mark.data
def test_real_mirror_maps_flip_left_and_right(data_set):
    shape = recognise(data_set("FAUST_5k_remeshed")).load("tr_reg_000")
    straight, flipped = (shape.mesh.vertices[m.indices] for m in (shape.truth, shape.mirror))
    moved = np.linalg.norm(straight - flipped, axis=1)
    assert np.median(moved) > 0.1 * np.sqrt(shape.mesh.area)
    assert (moved < 0.05 * np.sqrt(shape.mesh.area)).mean() > 0.02  # points near the plane of symmetry hardly move
