import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from csm.errors import DataError
from csm.mesh.correspondence import Direction
from csm.mesh.io import read_labels, read_names, read_pairs, read_vts, write_map

TO_SHAPE, TO_TEMPLATE = Direction.TEMPLATE_TO_SHAPE, Direction.SHAPE_TO_TEMPLATE


def test_vts_is_one_based_template_to_shape(tmp_path):
    (tmp_path / "a.vts").write_text("3\n1\n3\n")
    found = read_vts(tmp_path / "a.vts", 4)
    assert found.indices.tolist() == [2, 0, 2]
    assert found.direction is TO_SHAPE
    assert (found.n_from, found.n_to) == (3, 4)


@pytest.mark.parametrize(
    "text", ["1\r\n2\r\n", " 1 \n\n2\n\n", "1.0000000e+00\n2.0e0\n", "# head\n1\n2 # two\n", "1\n2"]
)
def test_vts_forms(tmp_path, text):
    (tmp_path / "a.vts").write_text(text)
    assert read_vts(tmp_path / "a.vts", 2).indices.tolist() == [0, 1]


def test_a_map_read_the_wrong_way_round_is_explained(tmp_path):
    (tmp_path / "a.vts").write_text("\n".join(map(str, range(1, 11))))
    with pytest.raises(DataError) as caught:
        read_vts(tmp_path / "a.vts", 5)
    message = str(caught.value)
    for part in (
        "a.vts",
        "entry 6 is 6",
        "1..5",
        "template -> shape",
        "vertex of the shape",
        "10 entries",
        "other way",
    ):
        assert part in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0\n1\n", r"entry 1 is 0, wanted 1\.\.3"),
        ("1\n-2\n", "entry 2 is -2"),
        ("1\n1.5\n", "entry 2 is 1.5, wanted a whole number"),
        ("1\nnan\n", "whole number"),
        ("1\nx\n", "one number per line"),
        ("1 2\n3 1\n", "entry 1 is '1 2', wanted one number per line"),
        ("1\n1e300\n", r"entry 2 is 1e\+300, wanted a whole number"),
        ("1\n-inf\n", "whole number"),
        ("", "no numbers"),
    ],
)
def test_bad_lists_are_refused_and_named(tmp_path, text, message):
    (tmp_path / "a.vts").write_text(text)
    with pytest.raises(DataError, match=rf"a\.vts.*{message}"):
        read_vts(tmp_path / "a.vts", 3)


def test_labels_with_their_direction_and_base(tmp_path):
    (tmp_path / "a.txt").write_text("0\n2\n-1\n")
    found = read_labels(tmp_path / "a.txt", direction=TO_TEMPLATE, base=0, n_to=3)
    assert found.indices.tolist() == [0, 2, -1]
    assert found.direction is TO_TEMPLATE
    with pytest.raises(DataError, match=r"entry 1 is 0, wanted 1\.\.3.*template point for vertex of the shape"):
        read_labels(tmp_path / "a.txt", direction=TO_TEMPLATE, base=1, n_to=3)


def test_labels_of_mat_files(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"labels": np.array([[2, 2, 1]], dtype=np.uint16)})
    assert read_labels(tmp_path / "a.mat", direction=TO_SHAPE, base=1, n_to=2).indices.tolist() == [1, 1, 0]
    (tmp_path / "b.mat").write_bytes(b"nonsense")
    with pytest.raises(DataError, match=r"b\.mat.*no MATLAB file"):
        read_labels(tmp_path / "b.mat", direction=TO_SHAPE, base=1, n_to=2)


@pytest.mark.parametrize("text", ["a\tb\nc d\n", "a,b\nc, d\n", "# x y z\na b\n\n  c   d \n", "\ufeffa b\nc d"])
def test_pairs(tmp_path, text):
    (tmp_path / "p.txt").write_text(text, encoding="utf-8")
    assert read_pairs(tmp_path / "p.txt") == [("a", "b"), ("c", "d")]


def test_bad_pairs_are_named(tmp_path):
    (tmp_path / "p.txt").write_text("a b\nc\n")
    with pytest.raises(DataError, match=r"p\.txt: entry 2 is 'c', wanted two names"):
        read_pairs(tmp_path / "p.txt")
    with pytest.raises(DataError, match="no such file"):
        read_pairs(tmp_path / "q.txt")


def test_names(tmp_path):
    (tmp_path / "n.txt").write_text("mesh000\n\n mesh001 \n")
    assert read_names(tmp_path / "n.txt") == ["mesh000", "mesh001"]


@settings(deadline=None)
@given(st.lists(st.integers(-1, 50), min_size=1))
def test_text_maps_read_back(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("map") / "m.txt"
    write_map(path, np.array(values), meaning="vertex of b.off for each vertex of a.off")
    assert path.read_text().startswith("# vertex of b.off for each vertex of a.off; 0-based")
    assert read_labels(path, direction=TO_SHAPE, base=0, n_to=51).indices.tolist() == values


def test_npz_and_vts_maps_read_back(tmp_path):
    values = np.array([4, 0, 2])
    write_map(tmp_path / "m.npz", values, meaning="a to b")
    with np.load(tmp_path / "m.npz", allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["indices"], values)
        assert str(archive["meaning"]) == "a to b"
    write_map(tmp_path / "m.vts", values)
    assert (tmp_path / "m.vts").read_text() == "5\n1\n3\n"
    np.testing.assert_array_equal(read_vts(tmp_path / "m.vts", 5).indices, values)


def test_a_vts_file_cannot_say_none(tmp_path):
    with pytest.raises(DataError, match="point 1 has no counterpart"):
        write_map(tmp_path / "m.vts", np.array([0, -1]))
    with pytest.raises(DataError, match="maps are written as"):
        write_map(tmp_path / "m.csv", np.array([0]))
    assert list(tmp_path.iterdir()) == []


def test_errors_name_the_file_as_it_was_given(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.txt").write_text("x\n")
    (tmp_path / "a.mat").write_bytes(b"x")
    for typed in ("./a.txt", "../" + tmp_path.name + "/a.txt", "./a.mat"):
        with pytest.raises(DataError) as caught:
            read_labels(typed, direction=TO_SHAPE, base=0, n_to=3)
        assert str(caught.value).startswith(typed + ": ")


def test_labels_of_a_damaged_mat_are_one_sentence(tmp_path):
    whole = tmp_path / "a.mat"
    scipy.io.savemat(whole, {"labels": np.arange(5.0)})
    data = whole.read_bytes()
    for end in range(1, len(data), 9):
        whole.write_bytes(data[:end])
        with pytest.raises(DataError, match=r"a\.mat: "):
            read_labels(whole, direction=TO_SHAPE, base=0, n_to=5)
