import io

import h5py
import numpy as np
import pytest
import scipy.io

from csm.errors import MeshError
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


BROKEN = {
    "no shape": ({"desc": np.eye(3)}, r"found 0 \(none\)"),
    "two shapes": (
        {"a": {"VERT": MESH.vertices, "TRIV": TRIV}, "b": {"VERT": MESH.vertices, "TRIV": TRIV}},
        r"\(a, b\)",
    ),
    "unequal": ({"shape": {**XYZ, "Y": XYZ["Y"][:-1], "TRIV": TRIV}}, "wanted equal numbers"),
    "fractions": ({"shape": {**XYZ, "TRIV": TRIV + 0.5}}, "not whole"),
}


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
@pytest.mark.parametrize(("variables", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_files_say_what_is_wrong(variables, message, write):
    with pytest.raises(MeshError, match=message):
        parse_mat(write(variables))


@pytest.mark.parametrize("data", [b"nonsense", b"\x89HDF\r\n\x1a\nnonsense", v7(SPELLINGS["VERT"])[:700]])
def test_damaged_files_are_named_so(data):
    with pytest.raises(MeshError, match="no MATLAB file or it is damaged"):
        parse_mat(data)


@pytest.mark.parametrize("write", [v7, v73], ids=["v7", "v7.3"])
@pytest.mark.parametrize("variables", [{"labels": [[3, 1, 2]], "n": [[7]]}, {"anything": [[3], [1], [2]]}])
def test_label_vectors(variables, write):
    assert label_vector(write({k: np.array(v) for k, v in variables.items()})).tolist() == [3, 1, 2]


def test_an_unclear_choice_of_labels_is_refused():
    with pytest.raises(MeshError, match="found a, b"):
        label_vector(v7({"a": np.eye(2), "b": np.eye(2)}))
