import io
import itertools
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io import _hdf5, matlab73, read_mesh
from csm.mesh.io.matlab73 import is_hdf5, read_hdf5
from tests.shapes import blob

MESH = blob(1)


@pytest.fixture
def other(tmp_path):
    """A file of the user's that no mesh file has any business with."""
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["VERT"] = MESH.vertices.T
    (tmp_path / "secret.txt").write_bytes(b"s" * 3000)
    return tmp_path


def new(path) -> h5py.File:
    file = h5py.File(path, "w", userblock_size=512)
    file["TRIV"] = (MESH.faces + 1).T.astype(float)
    return file


def external_link(file, folder):
    file["VERT"] = h5py.ExternalLink(str(folder / "secret.h5"), "/VERT")


def external_link_behind_a_soft_one(file, folder):
    file["#out"] = h5py.ExternalLink(str(folder / "secret.h5"), "/")
    file["VERT"] = h5py.SoftLink("/#out/VERT")


def external_storage(file, folder):
    file.create_dataset("VERT", (3, 42), "f8", external=[(str(folder / "secret.txt"), 0, 1008)])


def virtual(file, folder):
    layout = h5py.VirtualLayout((3, 42), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "secret.h5"), "VERT", (3, 42))
    file.create_virtual_dataset("VERT", layout)


@pytest.mark.parametrize("put", [external_link, external_link_behind_a_soft_one, external_storage, virtual])
def test_other_files_of_the_computer_are_never_read(other, put):
    with new(other / "a.mat") as file:
        put(file, other)
    with h5py.File(other / "a.mat") as file:
        assert file["VERT"][()].shape == (3, 42)  # what the library itself would give away
    with pytest.raises(MeshError, match=r"a\.mat: it (has an external link|keeps an array in another file)"):
        read_mesh(other / "a.mat")


def test_links_inside_of_the_file_are_followed(tmp_path):
    with new(tmp_path / "a.mat") as file:
        file["hidden/points"] = MESH.vertices.T
        file["shape/VERT"] = h5py.SoftLink("/hidden/points")
        file["shape/TRIV"] = h5py.SoftLink("../TRIV")
        file["shape/tri"] = file["TRIV"]
        file["shape/gone"] = h5py.SoftLink("/nowhere")
        file["shape/round"] = h5py.SoftLink("/shape/round")
    mesh = read_mesh(tmp_path / "a.mat")
    assert mesh.digest == MESH.digest


def test_groups_linked_into_each_other_are_visited_once():
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        groups = [file.create_group(f"g{i}") for i in range(40)]
        for inner, outer in itertools.pairwise(groups):
            for key in "abcdef":
                outer[key] = inner
        groups[0]["round"] = groups[-1]
        file["VERT"], file["TRIV"] = MESH.vertices.T, MESH.faces.T
    start = time.perf_counter()
    found = read_hdf5(stream.getvalue())
    assert time.perf_counter() - start < 5
    np.testing.assert_array_equal(found["VERT"], MESH.vertices)


def test_groups_nested_without_end_are_refused():
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.create_group("/".join("a" * 200))
    with pytest.raises(MeshError, match="nested more than 50"):
        read_hdf5(stream.getvalue())


def test_an_array_that_announces_more_than_is_stored_is_refused():
    for options in ({"chunks": (3, 1000)}, {}, {"chunks": (3, 1000), "compression": "gzip"}):
        stream = io.BytesIO()
        with h5py.File(stream, "w") as file:
            file.create_dataset("VERT", (3, 10**8), "f8", **options)
        with pytest.raises(MeshError, match="announces 2400000000 bytes, but 0 are stored"):
            read_hdf5(stream.getvalue())


def test_arrays_may_not_be_large_together(monkeypatch):
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for i in range(4):
            file.create_dataset(f"a{i}", data=np.zeros(1000), compression="gzip")
    monkeypatch.setattr(_hdf5, "_LARGEST", 31_999)
    answer, blobs = _hdf5.answer(stream.getvalue())
    assert "more than csm reads" in answer["refused"]
    assert blobs == []


def test_a_library_that_is_busy_without_end_is_stopped(tmp_path, monkeypatch):
    program = tmp_path / "busy.py"
    program.write_text(
        f"import sys\nsys.path.insert(0, {str(Path(_hdf5.__file__).parents[3])!r})\n"
        "from csm.mesh.io._hdf5 import limit\nlimit(0)\nwhile True: pass\n"
    )
    monkeypatch.setattr(matlab73, "_PROGRAM", program)
    with pytest.raises(MeshError, match="still busy with it when its time was over"):
        read_hdf5(b"")


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", r"ended the HDF5 library \(signal 11\)"),
        ("raise ImportError('no h5py')", "cannot read it .*no h5py"),
        ("import time; time.sleep(9)", "took more than 1 seconds"),
        ("pass", "it ended early"),
    ],
)
def test_a_process_that_ends_otherwise_is_one_sentence(tmp_path, monkeypatch, code, message):
    (tmp_path / "other.py").write_text(code)
    monkeypatch.setattr(matlab73, "_PROGRAM", tmp_path / "other.py")
    monkeypatch.setattr(matlab73, "_LONGEST", 1.0)
    with pytest.raises(MeshError, match=message):
        read_hdf5(b"")


def test_cells_arrays_of_structs_and_text_as_matlab_writes_them():
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        hidden = file.create_group("#refs#")
        parts = [hidden.create_dataset(str(i), data=np.full((2, 3), float(i))) for i in range(4)]
        refs = np.array([part.ref for part in parts], dtype=h5py.ref_dtype)
        file.create_dataset("cell", data=refs.reshape(4, 1)).attrs["MATLAB_class"] = np.bytes_("cell")
        structs = file.create_group("structs")
        structs.attrs["MATLAB_class"] = np.bytes_("struct")
        structs["X"], structs["Y"] = refs[:2].reshape(2, 1), refs[2:].reshape(2, 1)
        file.create_dataset("text", data=np.array([[104], [105]], np.uint16)).attrs["MATLAB_class"] = np.bytes_("char")
        file.create_dataset("none", data=np.array([0, 0], np.uint64)).attrs["MATLAB_empty"] = 1
        pair = np.zeros(2, dtype=[("real", "f8"), ("imag", "f8")])
        pair["imag"] = np.inf
        file["complex"] = pair
    found = read_hdf5(stream.getvalue())
    assert [a[0, 0] for a in found["cell"]] == [0, 1, 2, 3]
    assert [(s["X"][0, 0], s["Y"][0, 0]) for s in found["structs"]] == [(0, 2), (1, 3)]
    assert found["text"] is None
    assert found["none"].size == 0
    assert found["complex"].tolist() == [complex(0, np.inf)] * 2


def test_what_is_hdf5_is_told_with_and_without_a_header_in_front():
    for size in (0, 512, 1024):
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=size) as file:
            file["a"] = 1.0
        assert is_hdf5(stream.getvalue())
    assert not is_hdf5(b"OFF")
