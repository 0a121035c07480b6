import base64
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.io import read_mesh
from csm.mesh.io.gltf import parse_gltf
from tests.shapes import blob, rotation, sphere

MESH = blob(1)
CASES = Path(__file__).parents[2] / "cases"


def nothing(name: str) -> bytes:
    raise AssertionError(f"{name} was opened")


def of_trimesh(mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def built(arrays: list, meshes: list, **more) -> dict:
    """A document whose accessors are these arrays, all in one buffer inside of it."""
    kinds = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i2": 5122, "i1": 5120}
    blob, accessors, views = b"", [], []
    for array in map(np.asarray, arrays):
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": kinds[array.dtype.str[1:]],
                "count": len(array),
                "type": "VEC3" if array.ndim == 2 else "SCALAR",
            }
        )
        blob += array.tobytes() + bytes(-array.nbytes % 4)
    uri = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
    buffers = [{"byteLength": len(blob), "uri": uri}]
    document = {"asset": {"version": "2.0"}, "buffers": buffers, "bufferViews": views, "accessors": accessors}
    return {**document, "meshes": meshes, **more}


def parsed(document: dict, choose=None):
    return parse_gltf(json.dumps(document).encode(), choose, nothing)


POINTS = MESH.vertices.astype("<f4")
CORNERS = MESH.faces.astype("<u2").ravel()
ONE = [{"name": "blob", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]


def test_a_glb_of_another_library_keeps_order_and_number():
    raw = parse_gltf(of_trimesh(MESH).export(file_type="glb") + b"rest", None, nothing)
    np.testing.assert_array_equal(raw.vertices, POINTS)
    np.testing.assert_array_equal(raw.faces, MESH.faces)
    assert raw.notes == ("4 bytes follow its end; they were not read",)


def test_the_case_is_the_mesh_of_the_others():
    mesh, reference = read_mesh(CASES / "mesh.glb"), read_mesh(CASES / "plain.off.gz")
    np.testing.assert_allclose(mesh.vertices, reference.vertices, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, reference.faces)


def test_a_gltf_with_its_buffer_in_a_file_beside_it(tmp_path):
    for name, data in of_trimesh(MESH).export(file_type="gltf").items():
        (tmp_path / name).write_bytes(data)
    mesh = read_mesh(tmp_path / "model.gltf")
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    next(tmp_path.glob("*.bin")).unlink()
    with pytest.raises(MeshError, match=r"model\.gltf: .*\.bin: there is no such file"):
        read_mesh(tmp_path / "model.gltf")


@pytest.mark.parametrize("uri", ["/etc/passwd", "../a.bin", "a/../../b", "file:///etc/passwd", "C:\\a", "%2e%2e/a", ""])
def test_files_elsewhere_are_never_opened(uri):
    document = built([POINTS, CORNERS], ONE)
    document["buffers"][0]["uri"] = uri
    with pytest.raises(MeshError, match="csm reads only files beside it"):
        parsed(document)


@pytest.mark.parametrize("kind", ["<u1", "<u2", "<u4"])
def test_indices_of_every_type(kind):
    raw = parsed(built([POINTS, CORNERS.astype(kind)], ONE))
    np.testing.assert_array_equal(raw.vertices, POINTS)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


def test_without_indices_strips_fans_and_whole_numbers():
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 3, 0], [0, 4, 0]], "<i2")
    for mode, faces in ((4, [[0, 1, 2], [3, 4, 5]]), (5, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]])):
        raw = parsed(built([square], [{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}]))
        assert raw.faces.tolist() == faces
        np.testing.assert_array_equal(raw.vertices, square)
    fan = parsed(built([square], [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]))
    assert fan.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    document = built([square], [{"primitives": [{"attributes": {"POSITION": 0}}]}])
    document["accessors"][0]["normalized"] = True
    np.testing.assert_allclose(parsed(document).vertices, square / 32767)


def test_the_scene_places_the_mesh_and_a_mirror_turns_its_faces():
    turn, scale = rotation(3), np.array([1.0, 2.0, -3.0])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * scale, [1, 2, 3]
    quaternion = trimesh.transformations.quaternion_from_matrix(turn)
    moved = {"rotation": np.roll(quaternion, -1).tolist(), "scale": scale.tolist(), "translation": [1, 2, 3]}
    for node in (moved, {"matrix": matrix.T.ravel().tolist()}):
        nodes = [{"children": [1]}, {"mesh": 0, **node}]
        raw = parsed(built([POINTS, CORNERS], ONE, scenes=[{"nodes": [0]}], nodes=nodes))
        np.testing.assert_allclose(raw.vertices, POINTS.astype(float) @ (turn * scale).T + [1, 2, 3], atol=1e-6)
        np.testing.assert_array_equal(raw.faces, MESH.faces[:, ::-1])
        assert raw.notes == ("the vertices are where the scene of the file puts them",)


def test_several_meshes_have_to_be_chosen_from_or_joined():
    scene = trimesh.Scene()
    scene.add_geometry(of_trimesh(MESH), geom_name="blob")
    scene.add_geometry(of_trimesh(sphere(1)), geom_name="ball")
    data = scene.export(file_type="glb")
    with pytest.raises(MeshError, match=r"it holds 2 shapes \(blob, ball\), wanted one; choose"):
        parse_gltf(data, None, nothing)
    np.testing.assert_array_equal(parse_gltf(data, 1, nothing).faces, sphere(1).faces)
    both = parse_gltf(data, "all", nothing)
    np.testing.assert_array_equal(both.faces, np.concatenate([MESH.faces, sphere(1).faces + MESH.n_vertices]))


def test_parts_that_use_one_list_of_vertices_are_one_shape():
    parts = [{"attributes": {"POSITION": 0}, "indices": i} for i in (1, 2)]
    document = built([POINTS, CORNERS[:90], CORNERS[90:]], [{"primitives": parts}])
    np.testing.assert_array_equal(parsed(document).faces, MESH.faces)
    parts[1]["attributes"] = {"POSITION": 3}
    document = built([POINTS, CORNERS[:90], CORNERS[90:], POINTS], [{"name": "m", "primitives": parts}])
    with pytest.raises(MeshError, match=r"it holds 2 shapes \(m, part 0, m, part 1\)"):
        parsed(document)


def altered(change) -> dict:
    document = built([POINTS, CORNERS], json.loads(json.dumps(ONE)))
    change(document)
    return document


REFUSED = {
    "count": (lambda d: d["accessors"][0].update(count=10**12), "announces 1000000000000 rows"),
    "view": (lambda d: d["bufferViews"][0].update(byteLength=10**12), "ends before|end before"),
    "negative": (lambda d: d["accessors"][0].update(count=-1), "sizes that make no sense"),
    "word": (lambda d: d["accessors"][0].update(count="many"), "sizes that make no sense"),
    "no view": (lambda d: d["accessors"][0].pop("bufferView"), "sparse"),
    "draco": (
        lambda d: d["meshes"][0]["primitives"][0].update(extensions={"KHR_draco_mesh_compression": {}}),
        "blob is compressed with KHR_draco_mesh_compression; export",
    ),
    "reference": (lambda d: d["meshes"][0]["primitives"][0].update(indices=9), "number 9 of its accessors"),
    "points": (lambda d: d["meshes"][0]["primitives"][0].update(mode=0), "holds no mesh of triangles"),
    "cycle": (lambda d: d.update(scenes=[{"nodes": [0]}], nodes=[{"mesh": 0, "children": [0]}]), "has two parents"),
    "base64": (lambda d: d["buffers"][0].update(uri="data:,@@@"), "inside of its json is damaged"),
    "asset": (lambda d: d.pop("asset"), "wanted glTF"),
}


@pytest.mark.parametrize(("change", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_read_is_one_sentence(change, message):
    with pytest.raises(MeshError, match=message):
        parsed(altered(change))


def test_a_cut_or_nested_file_is_one_sentence():
    whole = of_trimesh(MESH).export(file_type="glb")
    for end in (8, 16, 60, len(whole) - 1):
        with pytest.raises(MeshError, match=r"cut short|cannot be read"):
            parse_gltf(whole[:end], None, nothing)
    with pytest.raises(MeshError, match="json cannot be read"):
        parse_gltf(b"[" * 100_000, None, nothing)
    with pytest.raises(MeshError, match="version 1, wanted version 2"):
        parse_gltf(whole[:4] + b"\1\0\0\0" + whole[8:], None, nothing)
