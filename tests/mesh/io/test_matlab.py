import io
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from csm.errors import MeshError
from csm.mesh.io import read_mesh
from csm.mesh.io.matlab import label_vector, parse_mat
from tests.shapes import blob

MESH = blob(2)
XYZ = {key: MESH.vertices[:, [i]] for i, key in enumerate("XYZ")}
TRIV = MESH.faces + 1


def v7(variables: dict) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables)
    return stream.getvalue()


def v73(variables: dict, userblock: bool = True) -> bytes:
    """Write HDF5 as MATLAB does: transposed arrays, structs as groups, its own header of 512 bytes in front."""
    stream = io.BytesIO()
    with h5py.File(stream, "w", userblock_size=512 if userblock else 0) as file:
        file.create_group("#refs#").create_dataset("a", data=np.zeros(2))

        def put(group, tree):
            for key, value in tree.items():
                if isinstance(value, dict):
                    put(group.create_group(key), value)
                else:
                    group.create_dataset(key, data=np.asarray(value).T)

        put(file, variables)
    data = bytearray(stream.getvalue())
    if userblock:
        data[:6] = b"MATLAB"
    return bytes(data)


SPELLINGS = {
    "shape.X": {"shape": {**XYZ, "TRIV": TRIV}},
    "shape.X of uint16": {"shape": {**XYZ, "TRIV": TRIV.astype(np.uint16), "n": MESH.n_vertices}},
    "shape.X of double": {"shape": {**XYZ, "TRIV": TRIV.astype(float)}},
    "surface.X as rows": {"surface": {k: v.T for k, v in XYZ.items()} | {"TRIV": TRIV}},
    "S.surface": {"S": {"surface": {**XYZ, "TRIV": TRIV}, "other": np.eye(3)}},
    "VERT": {"VERT": MESH.vertices, "TRIV": TRIV},
    "M.VERT": {"M": {"VERT": MESH.vertices, "TRIV": TRIV}},
    "0-based": {"VERT": MESH.vertices, "TRIV": MESH.faces},
}


@pytest.mark.parametrize("write", [v7, v73, lambda v: v73(v, userblock=False)], ids=["v7", "v7.3", "bare HDF5"])
@pytest.mark.parametrize("variables", SPELLINGS.values(), ids=SPELLINGS.keys())
def test_every_spelling_and_version_gives_the_same_mesh(variables, write):
    raw = parse_mat(write(variables))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
def test_one_triangle_is_not_transposed(write):
    vertices = np.arange(9.0).reshape(3, 3)
    raw = parse_mat(write({"VERT": vertices, "TRIV": np.array([[1, 3, 2]])}))
    np.testing.assert_array_equal(raw.vertices, vertices)
    np.testing.assert_array_equal(raw.faces, [[0, 2, 1]])


FIELDS = {
    "lower case": {"vert": MESH.vertices, "triv": TRIV},
    "words": {"vertices": MESH.vertices, "faces": TRIV},
    "letters": {"V": MESH.vertices, "F": TRIV},
    "short words": {"verts": MESH.vertices, "tri": TRIV},
    "X of three columns": {"X": MESH.vertices, "TRIV": TRIV},
    "beside other numbers": {"VERT": MESH.vertices, "TRIV": TRIV, "evecs": np.eye(9), "f": np.eye(5)},
}
SIDES = {
    "VERT": {"VERT": MESH.vertices.T, "TRIV": TRIV},
    "TRIV": {"VERT": MESH.vertices, "TRIV": TRIV.T},
    "both": {"VERT": MESH.vertices.T, "TRIV": TRIV.T},
    "TRIV beside X, Y, Z": {**XYZ, "TRIV": TRIV.T},
}


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
@pytest.mark.parametrize("variables", [*FIELDS.values(), *SIDES.values()], ids=[*FIELDS, *SIDES])
def test_names_and_arrays_on_their_side_are_read_as_meant(variables, write):
    raw = parse_mat(write({"shape": variables}))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)
    np.testing.assert_array_equal(raw.faces, MESH.faces)
    lying = sum(np.shape(a)[0] == 3 for key, a in variables.items() if key in ("VERT", "TRIV"))
    assert len([note for note in raw.notes if "read as the transpose" in note]) == lying


SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
SIDES_OF_IT = np.array([[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]])


def test_a_tetrahedron_is_read_the_same_lying_and_standing():
    for turn in (np.asarray, np.transpose):
        raw = parse_mat(v7({"VERT": turn(TETRAHEDRON), "TRIV": turn(SIDES_OF_IT)}))
        np.testing.assert_array_equal(raw.vertices, TETRAHEDRON)
        np.testing.assert_array_equal(raw.faces, SIDES_OF_IT - 1)


AMBIGUOUS = {
    "3 x 3 and 3 x 3": {"VERT": SQUARE, "TRIV": np.array([[1, 2, 3]] * 3)},
    "3 faces or 3 corners": {"VERT": np.zeros((5, 3)), "TRIV": np.ones((3, 4))},
    "lying vertices": {"VERT": np.zeros((3, 5)), "TRIV": np.ones((4, 3))},
    "X, Y, Z as rows": {"X": [[1, 2, 3]], "Y": [[1, 2, 3]], "Z": [[1, 2, 3]], "TRIV": np.ones((3, 3))},
}


@pytest.mark.parametrize("variables", AMBIGUOUS.values(), ids=AMBIGUOUS.keys())
def test_what_can_be_read_in_two_ways_is_an_error_that_says_so(variables):
    with pytest.raises(MeshError, match=r"nothing tells rows from columns|both in rows and in columns"):
        parse_mat(v7(variables))


def test_other_arrays_settle_three_by_three():
    faces = np.array([[1, 2, 3], [1, 3, 4], [1, 4, 5]])
    points = np.arange(15.0).reshape(5, 3)
    for turn in (np.asarray, np.transpose):
        np.testing.assert_array_equal(parse_mat(v7({"VERT": turn(points), "TRIV": turn(faces)})).faces, faces - 1)


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
def test_four_columns_are_quads_and_nan_fills_up(write):
    quads = np.array([[1, 2, 3, 4], [4, 3, 2, 1], [1, 3, 2, 4], [2, 1, 3, 4], [1, 2, 4, 3]])
    points = np.arange(15.0).reshape(5, 3)
    assert parse_mat(write({"VERT": points, "TRIV": quads})).faces.tolist() == (quads - 1).tolist()
    assert parse_mat(write({"VERT": points, "TRIV": quads.T})).faces.tolist() == (quads - 1).tolist()
    mixed = np.array([[1, 2, 3, np.nan, np.nan], [1, 2, 3, 4, 5], [2, 3, 4, 5, np.nan], [3, 4, 5, np.nan, np.nan]])
    raw = parse_mat(write({"vertices": points, "TRIV": mixed}))
    assert raw.sizes.tolist() == [3, 5, 4, 3]
    assert raw.corners.tolist() == [0, 1, 2, 0, 1, 2, 3, 4, 1, 2, 3, 4, 2, 3, 4]


BROKEN = {
    "no shape": ({"desc": np.eye(3)}, "found none"),
    "two shapes": (
        {"a": {"VERT": MESH.vertices, "TRIV": TRIV}, "b": {"VERT": MESH.vertices, "TRIV": TRIV}},
        r"it holds 2 shapes \(a, b\), wanted one; choose it by its number from 0 to 1, as in .*choose=0",
    ),
    "unequal": ({"shape": {**XYZ, "Y": XYZ["Y"][:-1], "TRIV": TRIV}}, "wanted equal numbers"),
    "fractions": ({"shape": {**XYZ, "TRIV": TRIV + 0.5}}, "shape: faces hold 1.5, wanted whole numbers"),
    "complex": ({"M": {"VERT": MESH.vertices * 1j, "TRIV": TRIV}}, "M: vertices are complex .*imaginary part would be"),
    "complex X": ({"M": {**XYZ, "X": XYZ["X"] * 1j, "TRIV": TRIV}}, "M: X are complex"),
    "two columns": ({"VERT": MESH.vertices[:, :2], "TRIV": TRIV}, "the vertices are 162 x 2, wanted N x 3"),
    "five columns": ({"VERT": MESH.vertices, "TRIV": np.ones((9, 5))}, "the faces are 9 x 5, wanted M x 3"),
    "three axes": ({"VERT": MESH.vertices, "TRIV": np.ones((2, 2, 2))}, "the faces are 2 x 2 x 2"),
}


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
@pytest.mark.parametrize(("variables", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_files_say_what_is_wrong(variables, message, write):
    with pytest.raises(MeshError, match=message):
        parse_mat(write(variables))


@pytest.mark.parametrize("data", [b"nonsense", b"\x89HDF\r\n\x1a\nnonsense", v7(SPELLINGS["VERT"])[:700]])
def test_damaged_files_are_named_so(data):
    with pytest.raises(MeshError, match=r"no MATLAB file|it is damaged|cut short"):
        parse_mat(data)


def a_cell() -> bytes:
    shapes = np.empty((1, 2), dtype=object)
    shapes[0, 0] = {"VERT": MESH.vertices, "TRIV": TRIV}
    shapes[0, 1] = {"VERT": MESH.vertices * 2, "TRIV": TRIV}
    return v7({"shapes": shapes})


def test_a_shape_of_a_cell_can_be_chosen_or_all_be_joined():
    with pytest.raises(MeshError, match=r"holds 2 shapes \(shapes\[0\], shapes\[1\]\)"):
        parse_mat(a_cell())
    for i, factor in enumerate((1, 2)):
        np.testing.assert_array_equal(parse_mat(a_cell(), choose=i).vertices, MESH.vertices * factor)
    both = parse_mat(a_cell(), choose="all")
    np.testing.assert_array_equal(both.vertices, np.concatenate([MESH.vertices, MESH.vertices * 2]))
    np.testing.assert_array_equal(both.faces, np.concatenate([MESH.faces, MESH.faces + MESH.n_vertices]))
    with pytest.raises(MeshError, match=r"there is no choose=2: it holds 2 shapes"):
        parse_mat(a_cell(), choose=2)


CASES = Path(__file__).parents[2] / "cases"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("cell_of_shapes", "it holds 2 shapes"),
        ("damaged/m_quadcube", r"face 0 has 4 corners \(216 of 216 faces"),
        ("damaged/m_complex", "complex"),
        ("damaged/h5huge", "announces 4800000000 bytes"),
        ("damaged/segmentation_fault", "it is cut short"),
        ("damaged/takes_10_gigabytes", "it is damaged|it is cut short"),
    ],
)
def test_cases_that_are_refused_in_one_sentence_that_names_the_file(name, sentence):
    path = CASES / f"{name}.mat"
    with pytest.raises(MeshError, match=sentence) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["VERT_3xN", "VERT_Nx3_TRIV_3xM", "v73_h5py_by_hand_not_transposed"])
def test_cases_on_their_side_are_read_as_meant(name):
    reference = read_mesh(CASES / "plain.off.gz")
    mesh = read_mesh(CASES / f"{name}.mat")
    np.testing.assert_allclose(mesh.vertices, reference.vertices, atol=1e-12)
    np.testing.assert_array_equal(mesh.faces, reference.faces)
    assert any("transpose" in note for note in mesh.notes)


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
@pytest.mark.parametrize("variables", [{"labels": [[3, 1, 2]], "n": [[7]]}, {"anything": [[3], [1], [2]]}])
def test_label_vectors(variables, write):
    assert label_vector(write({k: np.array(v) for k, v in variables.items()})).tolist() == [3, 1, 2]


def test_an_unclear_choice_of_labels_is_refused():
    with pytest.raises(MeshError, match="found a, b"):
        label_vector(v7({"a": np.eye(2), "b": np.eye(2)}))
