from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image as Pillow

from csm.errors import ConfigError, DataError, MeshError
from csm.mesh.io import read_mesh
from csm.mesh.io.textured import read_textured, write_textured
from csm.mesh.textured import Image, Textured
from tests.shapes import blob

MESH = blob(1)
CASES = Path(__file__).parent.parent.parent / "cases"

SQUARE = """mtllib my lib.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 5
vt 0 0
vt 1 0
vt 1 1
vt 0 1 0
usemtl skin one
f 1/1 2/2/ 3/3/7 -2/-1
usemtl other
f 1/1 2/2 5/3
f 1 3//2 5
"""


def picture(seed: int = 0) -> bytes:
    file = io.BytesIO()
    Pillow.fromarray(np.random.default_rng(seed).integers(0, 255, (4, 4, 3), dtype=np.uint8)).save(file, "png")
    return file.getvalue()


def textured(n_images: int = 1) -> Textured:
    """A mesh whose coordinates jump from face to face; some faces have none."""
    rng = np.random.default_rng(5)
    uv = rng.random((MESH.n_faces, 3, 2)).astype(np.float32).astype(float)
    uv[::9] = np.nan
    images = tuple(Image(".png", picture(i)) for i in range(n_images))
    return Textured(MESH, uv, images, rng.integers(0, n_images, MESH.n_faces) if n_images else None)


def square(folder: Path, mtl: str = "newmtl skin one\nmap_Kd -s 1 1 -clamp on pictures/a b.png\n") -> Path:
    (folder / "square.obj").write_text(SQUARE)
    (folder / "my lib.mtl").write_text(mtl)
    (folder / "pictures").mkdir(exist_ok=True)
    (folder / "pictures" / "a b.png").write_bytes(picture())
    return folder / "square.obj"


@pytest.mark.parametrize("n_images", [0, 1, 3])
def test_an_obj_reads_back_with_the_same_bits(tmp_path, n_images):
    texture = textured(n_images)
    written = write_textured(tmp_path / "a b.obj", texture)
    assert sorted(written) == sorted(tmp_path.iterdir())
    again = read_textured(tmp_path / "a b.obj")
    np.testing.assert_array_equal(again.uv, texture.uv)
    np.testing.assert_array_equal(again.image_numbers, texture.image_numbers)
    assert again.images == texture.images
    assert again.notes == ()
    assert again.mesh.digest == MESH.digest == read_mesh(tmp_path / "a b.obj").digest


@pytest.mark.parametrize("n_images", [0, 1, 3])
def test_a_glb_reads_back_with_the_same_faces(tmp_path, n_images):
    texture = textured(n_images)
    assert write_textured(tmp_path / "a.glb", texture) == (tmp_path / "a.glb",)
    again = read_textured(tmp_path / "a.glb")
    order = np.argsort(texture.image_numbers, kind="stable")
    shown = texture.image_numbers[order] >= 0
    np.testing.assert_allclose(again.mesh.corners, MESH.corners[order], atol=1e-6)
    np.testing.assert_allclose(again.uv[shown], texture.uv[order][shown], atol=1e-6)
    np.testing.assert_array_equal(again.image_numbers, texture.image_numbers[order])
    assert set(again.images) == set(texture.images)
    assert read_mesh(tmp_path / "a.glb").digest == again.mesh.digest


@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_another_library_reads_what_was_written(tmp_path, suffix):
    uv = np.random.default_rng(0).random((MESH.n_vertices, 2))
    write_textured(tmp_path / f"a{suffix}", Textured(MESH, uv[MESH.faces], (Image(".png", picture()),)))
    found = trimesh.load(tmp_path / f"a{suffix}", force="mesh", process=False)
    material = found.visual.material
    image = material.image if suffix == ".obj" else material.baseColorTexture
    np.testing.assert_array_equal(np.asarray(image), np.asarray(Pillow.open(io.BytesIO(picture()))))
    at = [np.abs(MESH.vertices - v).sum(1).argmin() for v in found.vertices]
    np.testing.assert_allclose(found.visual.uv, uv[at], atol=1e-6)


def test_what_another_library_wrote_is_read(tmp_path):
    uv = np.random.default_rng(0).random((MESH.n_vertices, 2))
    visual = trimesh.visual.TextureVisuals(uv, image=Pillow.open(io.BytesIO(picture())))
    other = trimesh.Trimesh(MESH.vertices, MESH.faces, visual=visual, process=False)
    (tmp_path / "a.glb").write_bytes(other.export(file_type="glb"))
    found = read_textured(tmp_path / "a.glb")
    np.testing.assert_allclose(found.uv, uv[MESH.faces], atol=1e-6)
    np.testing.assert_array_equal(found.mesh.faces, MESH.faces)
    np.testing.assert_array_equal(
        np.asarray(Pillow.open(io.BytesIO(found.images[0].data))), np.asarray(visual.material.image)
    )


def test_polygons_names_with_blanks_and_options_are_read(tmp_path):
    found = read_textured(square(tmp_path))
    assert found.mesh.n_faces == 4
    for face, uv in zip(found.mesh.faces[:2], found.uv[:2], strict=True):
        np.testing.assert_array_equal(uv, found.mesh.vertices[face, :2])
    np.testing.assert_array_equal(found.uv[2], [[0, 0], [1, 0], [1, 1]])
    assert np.isnan(found.uv[3]).all()
    assert found.image_numbers.tolist() == [0, 0, -1, -1]
    assert found.images == (Image(".png", picture()),)


def test_what_is_not_beside_the_file_is_left_out_and_noted(tmp_path):
    for name in ("gone.png", "../pictures/a.png", "C:\\\\work\\\\skin.png", "/etc/passwd"):
        found = read_textured(square(tmp_path, f"newmtl skin one\nmap_Kd {name}\n"))
        assert (found.images, found.image_numbers.max(), len(found.has_uv)) == ((), -1, 3)
        assert any("the file" in note for note in found.notes)
    (tmp_path / "my lib.mtl").unlink()
    assert any("'my lib.mtl'" in note for note in read_textured(tmp_path / "square.obj").notes)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("f 1/9 2/2 3/3", "refers to texture coordinates 9, but there are 4"),
        ("f 1/0 2/2 3/3", "corner '1/0', whose texture coordinates do not exist"),
        ("f 1/-7 2/2 3/3", "corner '1/-7'"),
        ("f 1/x 2/2 3/3", "corner '1/x'"),
        ("vt a b", "texture coordinates 4 are 'a b', wanted two numbers"),
    ],
)
def test_damaged_coordinates_are_named(tmp_path, line, said):
    path = square(tmp_path)
    path.write_text(SQUARE + line + "\n")
    with pytest.raises(MeshError, match=rf"square\.obj: .*{said}"):
        read_textured(path)


def test_files_of_others_are_not_replaced(tmp_path):
    write_textured(tmp_path / "a.obj", textured())
    write_textured(tmp_path / "a.obj", textured())
    (tmp_path / "a.png").write_bytes(b"mine")
    before = (tmp_path / "a.obj").read_bytes()
    with pytest.raises(DataError, match=r"a\.png: there is such a file with other content"):
        write_textured(tmp_path / "a.obj", textured())
    assert (tmp_path / "a.png").read_bytes() == b"mine"
    assert (tmp_path / "a.obj").read_bytes() == before


def test_a_gltf_with_data_inside_of_its_json_and_its_own_set_of_coordinates_is_read(tmp_path):
    binary = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<6H", 0, 0, 65535, 0, 0, 65535)
    document = {
        "asset": {"version": "2.0"},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_1": 1}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "data:image/jpeg;base64," + base64.b64encode(b"jpeg").decode()}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "normalized": True, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "buffers": [
            {"byteLength": 48, "uri": "data:application/octet-stream;base64," + base64.b64encode(binary).decode()}
        ],
    }
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    found = read_textured(tmp_path / "a.gltf")
    np.testing.assert_allclose(found.uv, [[[0, 1], [1, 1], [0, 0]]], atol=1e-12)
    assert found.images == (Image(".jpg", b"jpeg"),)
    document["images"] = [{"uri": "../a.jpg"}]
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(MeshError, match=r"a\.gltf: it names the file '\.\./a\.jpg'"):
        read_textured(tmp_path / "a.gltf")


def test_a_mesh_without_texture_is_read_as_such():
    for name in ("spot_reference.obj", "mesh.glb"):
        found = read_textured(CASES / name, choose=0 if name.endswith("glb") else None)
        assert found.images == ()
        assert found.mesh.digest == read_mesh(CASES / name, choose=0).digest


def test_other_formats_are_named(tmp_path):
    with pytest.raises(MeshError, match=r"a\.off: textures are read from \.obj, \.glb and \.gltf"):
        read_textured("a.off")
    with pytest.raises(MeshError, match=r"gone\.obj: there is no such file"):
        read_textured(tmp_path / "gone.obj")
    with pytest.raises(MeshError, match=r"a\.ply: textured meshes are written as \.obj or \.glb"):
        write_textured(tmp_path / "a.ply", textured())
    with pytest.raises(ConfigError, match="got a int"):
        read_textured(3)
