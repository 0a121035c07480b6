import collections
import gzip
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from csm.errors import MeshError
from csm.mesh.io import READABLE, WRITABLE, count_vertices, read_mesh, read_polygons, write_mesh
from csm.mesh.shape import Mesh
from tests.fuzz.fuzz_readers import FOUND, REFUSED, SOUND, attempt
from tests.fuzz.mutations import mutated
from tests.fuzz.seeds import seeds
from tests.shapes import blob, sphere

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def meshes(draw):
    n = draw(st.integers(1, 12))
    m = draw(st.integers(1, 12))
    return Mesh(draw(arrays(float, (n, 3), elements=FINITE)), draw(arrays(int, (m, 3), elements=st.integers(0, n - 1))))


@pytest.mark.parametrize("suffix", WRITABLE)
@settings(max_examples=40, deadline=None)
@given(mesh=meshes())
def test_any_mesh_reads_back_with_the_same_bits(tmp_path_factory, suffix, mesh):
    path = tmp_path_factory.mktemp("round") / f"a{suffix}"
    write_mesh(path, mesh)
    back = read_mesh(path)
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)


def test_name_is_the_stem_unless_given(tmp_path):
    write_mesh(tmp_path / "tr_reg_000.ply", sphere(1))
    assert read_mesh(tmp_path / "tr_reg_000.ply").name == "tr_reg_000"
    assert read_mesh(str(tmp_path / "tr_reg_000.ply"), "other").name == "other"


def test_a_one_based_file_is_named_as_such(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 1 2 3\n")
    with pytest.raises(MeshError, match=r"a\.off: face 0 refers to vertex 3.*1-based"):
        read_mesh(tmp_path / "a.off")


def test_unknown_missing_and_empty_files(tmp_path):
    (tmp_path / "a.off").write_text("")
    with pytest.raises(MeshError, match=r"a\.off: the file is empty"):
        read_mesh(tmp_path / "a.off")
    with pytest.raises(MeshError, match=r"b\.off: there is no such file"):
        read_mesh(tmp_path / "b.off")
    for name in ("a.fbx", "a"):
        (tmp_path / name).write_text("content")
    with pytest.raises(MeshError, match=r"does not read \.fbx; wanted \.off, \.ply"):
        read_mesh(tmp_path / "a.fbx")
    with pytest.raises(MeshError, match="without a suffix"):
        read_mesh(tmp_path / "a")
    with pytest.raises(MeshError, match="this is a folder, wanted a mesh; csm match folder="):
        read_mesh(tmp_path)
    with pytest.raises(MeshError, match=r"spot_half\.of: there is no such file; did you mean spot_half\.off"):
        read_mesh(Path(__file__).parents[2] / "cases/spot_half.of")


def test_polygons_give_a_sentence_that_names_clean_and_the_file_as_given(tmp_path, monkeypatch):
    (tmp_path / "a.off").write_text("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MeshError, match=r"^\./a\.off: face 0 has 4 corners.*`csm clean`"):
        read_mesh("./a.off")
    quad = read_polygons("./a.off")
    assert (quad.source, quad.name, quad.sizes.tolist()) == ("./a.off", "a", [4])


def test_source_and_notes_of_a_mesh(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n9 9 9\n")
    mesh = read_mesh(str(tmp_path / "a.off"))
    assert mesh.source == str(tmp_path / "a.off")
    assert mesh.notes == ("1 line follows the last face; it was not read",)


@pytest.mark.parametrize("suffix", WRITABLE)
def test_gzipped_files_are_read_like_plain_ones(tmp_path, suffix):
    write_mesh(tmp_path / f"a{suffix}", blob(1))
    data = (tmp_path / f"a{suffix}").read_bytes()
    (tmp_path / f"b{suffix}.GZ").write_bytes(gzip.compress(data[:99]) + gzip.compress(data[99:]) + b"rest")
    mesh = read_mesh(tmp_path / f"b{suffix}.GZ")
    assert mesh.digest == blob(1).digest
    assert mesh.name == "b"
    assert mesh.notes == ("4 bytes follow the compressed data; they were not read",)
    assert count_vertices(tmp_path / f"b{suffix}.GZ") == mesh.n_vertices


def test_a_damaged_or_cut_gz_is_named(tmp_path):
    whole = gzip.compress(b"OFF\n0 0 0\n" * 100)
    (tmp_path / "a.off.gz").write_bytes(whole[:-9])
    with pytest.raises(MeshError, match=r"a\.off\.gz: the compressed data is cut short"):
        read_mesh(tmp_path / "a.off.gz")
    (tmp_path / "a.off.gz").write_bytes(b"OFF")
    with pytest.raises(MeshError, match=r"a\.off\.gz: the compressed data is damaged"):
        read_mesh(tmp_path / "a.off.gz")


def test_a_bomb_is_refused_long_before_it_fills_the_memory(tmp_path):
    (tmp_path / "a.off.gz").write_bytes(gzip.compress(b"\n" * (40 << 20)))
    with pytest.raises(
        MeshError, match=r"a\.off\.gz: the compressed data becomes larger than 35 MiB, which is refused"
    ):
        read_mesh(tmp_path / "a.off.gz")


def test_there_is_no_choice_in_a_format_of_one_shape(tmp_path):
    write_mesh(tmp_path / "a.off", blob(1))
    assert read_mesh(tmp_path / "a.off", choose=0).digest == blob(1).digest
    with pytest.raises(MeshError, match=r"a\.off: a \.off file holds one shape, so there is no choose=1"):
        read_mesh(tmp_path / "a.off", choose=1)


@pytest.mark.parametrize("suffix", READABLE)
@settings(max_examples=60, deadline=None)
@given(data=st.binary(min_size=1, max_size=300))
def test_garbage_is_a_mesh_error_that_names_the_file(tmp_path_factory, suffix, data):
    path = tmp_path_factory.mktemp("garbage") / f"junk{suffix}"
    path.write_bytes(data)
    with pytest.raises(MeshError, match="junk"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", [".off", ".ply"])
@settings(max_examples=60, deadline=None)
@given(keep=st.floats(0.001, 0.999))
def test_a_cut_file_never_gives_another_number_of_vertices_or_faces(tmp_path_factory, suffix, keep):
    mesh = blob(1)
    path = tmp_path_factory.mktemp("cut") / f"a{suffix}"
    write_mesh(path, mesh)
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(keep * len(data)))])
    try:
        back = read_mesh(path)
    except MeshError:
        return
    # Only possible if the last number of a text file lost digits.
    assert suffix == ".off"
    assert (back.n_vertices, back.n_faces) == (mesh.n_vertices, mesh.n_faces)


@pytest.mark.parametrize("suffix", [".off", ".ply", ".obj"])
def test_count_vertices(tmp_path, suffix):
    write_mesh(tmp_path / f"a{suffix}", sphere(3))
    assert count_vertices(tmp_path / f"a{suffix}") == 642


def test_count_vertices_names_a_damaged_file(tmp_path):
    (tmp_path / "a.off").write_text("nonsense")
    with pytest.raises(MeshError, match=r"a\.off"):
        count_vertices(tmp_path / "a.off")


def test_colours_are_checked(tmp_path):
    mesh = sphere(1)
    with pytest.raises(MeshError, match="wanted uint8"):
        write_mesh(tmp_path / "a.ply", mesh, np.zeros((mesh.n_vertices, 3)))
    with pytest.raises(MeshError, match="wanted uint8"):
        write_mesh(tmp_path / "a.ply", mesh, np.zeros((3, 3), np.uint8))
    with pytest.raises(MeshError, match="no vertex colours"):
        write_mesh(tmp_path / "a.obj", mesh, np.zeros((mesh.n_vertices, 3), np.uint8))
    with pytest.raises(MeshError, match=r"does not write \.stl"):
        write_mesh(tmp_path / "a.stl", mesh)
    assert list(tmp_path.iterdir()) == []


def test_a_long_header_is_counted_too(tmp_path):
    write_mesh(tmp_path / "a.ply", sphere(1))
    data = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "a.ply").write_bytes(
        data.replace(b"element vertex", b"comment " + b"x" * 70000 + b"\nelement vertex", 1)
    )
    assert count_vertices(tmp_path / "a.ply") == 42


def test_thousands_of_damaged_files_are_read_or_refused_in_one_sentence(tmp_path):
    """The short form of `python -m tests.fuzz.fuzz_readers`; HDF5 has a process of its own and is left to that."""
    rng = random.Random(13)
    known = [(suffix, data) for suffix, data in seeds() if b"\x89HDF" not in data[:520]]
    outcomes = collections.Counter()
    for _ in range(2000):
        suffix, data = rng.choice(known)
        path = tmp_path / f"mesh{suffix}"
        path.write_bytes(mutated(data, rng))
        outcome, why = attempt(path)
        outcomes[outcome] += 1
        assert outcome != FOUND, why
    assert min(outcomes[SOUND], outcomes[REFUSED]) > 150


@pytest.mark.parametrize(("suffix", "data"), [*seeds()])
def test_the_files_that_are_damaged_there_are_sound(tmp_path, suffix, data):
    (tmp_path / f"a{suffix}").write_bytes(data)
    assert read_polygons(tmp_path / f"a{suffix}").n_vertices in (12, 60)


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "file", "n_vertices", "n_faces", "area"),
    [
        ("FAUST_6890", "shapes/tr_reg_000.mat", 6890, 13776, 1.7718802513328193),
        ("FAUST_10000", "tr_reg_080.off", 10000, 19996, None),
        ("FAUST_15000", "tr_reg_080.off", 15000, 29996, None),
        ("FAUST_5k_remeshed", "vtx_5k/tr_reg_000.off", 4999, 9994, None),
        ("TOSCA_5k_remeshed", "vtx_5k/cat0.off", 5000, 9996, None),
        ("SCAPE_5000", "shapes/mesh000.mat", 4999, 9994, 1.0),
        ("SHREC19_5k_remeshed", "1.obj", 5197, 10390, None),
    ],
)
def test_real_files(data_set, name, file, n_vertices, n_faces, area):
    mesh = read_mesh(data_set(name) / file)
    assert (mesh.n_vertices, mesh.n_faces) == (n_vertices, n_faces)
    assert count_vertices(data_set(name) / file) == n_vertices
    if area is not None:  # as the file itself states it
        assert mesh.area == pytest.approx(area, rel=1e-12)
