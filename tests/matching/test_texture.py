from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image as Pillow

from csm.errors import DataError
from csm.matching.barycentric import BarycentricMap, nearest_on_faces
from csm.matching.maps import VertexMap
from csm.matching.texture import pull_texture
from csm.mesh.io.textured import read_textured, write_textured
from csm.mesh.shape import Mesh
from csm.mesh.textured import Image, Textured
from tests.shapes import cylinder, sphere


def unrolled(mesh: Mesh) -> Textured:
    """Texture of a body about the z axis: the angle is u, with a seam where it jumps from 1 to 0, and z is v."""
    corners = mesh.corners
    u = np.arctan2(corners[..., 1], corners[..., 0]) / (2 * np.pi) + 0.5
    first = u[:, :1]
    u = u - np.round(u - first)
    low, high = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    return Textured(mesh, np.stack([u, (corners[..., 2] - low) / (high - low)], axis=2), (picture(),))


def picture() -> Image:
    file = io.BytesIO()
    Pillow.fromarray(np.random.default_rng(0).integers(0, 255, (8, 8, 3), dtype=np.uint8)).save(file, "png")
    return Image(".png", file.getvalue())


def onto(source: Mesh, target: Mesh) -> BarycentricMap:
    return nearest_on_faces(source.vertices, target.vertices, target.faces)


def longest(texture: Textured) -> float:
    return float(np.linalg.norm(texture.uv - np.roll(texture.uv, 1, axis=1), axis=2).max())


@pytest.mark.parametrize("mesh", [cylinder(), sphere(2)], ids=["cylinder", "sphere"])
def test_the_identity_keeps_every_coordinate_also_at_the_seam(mesh):
    texture = unrolled(mesh)
    plain = BarycentricMap.of_vertices(VertexMap(np.arange(mesh.n_vertices), mesh.n_vertices), mesh.faces)
    for along in (plain, onto(mesh, mesh)):
        found = pull_texture(texture, along, mesh, mesh)
        np.testing.assert_allclose(found.uv, texture.uv, atol=1e-9)
        assert found.images == texture.images
        assert (found.image_numbers == 0).all()


def test_a_relabelled_copy_gets_the_coordinates_of_the_same_faces():
    mesh, rng = cylinder(), np.random.default_rng(2)
    order, faces = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_faces)
    copy = Mesh(mesh.vertices[order], np.argsort(order)[mesh.faces][faces])
    along = BarycentricMap.of_vertices(VertexMap(order, mesh.n_vertices), mesh.faces)
    found = pull_texture(unrolled(mesh), along, copy, mesh)
    np.testing.assert_allclose(found.uv, unrolled(mesh).uv[faces], atol=1e-9)


@pytest.mark.parametrize("fine", [cylinder(n=24, m=30), cylinder(n=96, m=60)], ids=["as fine", "finer"])
@pytest.mark.parametrize("turn", [0.0, 0.05])
def test_another_mesh_of_the_same_body_gets_its_place_and_nothing_is_smeared(fine, turn):
    rough = cylinder(n=17, m=21)
    c, s = np.cos(turn), np.sin(turn)
    rough = Mesh(rough.vertices @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T, rough.faces)
    found = pull_texture(unrolled(fine), onto(rough, fine), rough, fine)
    wanted = unrolled(rough).uv
    away = found.uv - wanted
    away[..., 0] -= np.round(away[..., 0])  # the two sides of the seam are one place
    assert np.abs(away).max() < 0.01
    assert longest(found) < 1.2 * longest(unrolled(rough))


def test_faces_without_partner_or_on_faces_without_texture_have_none():
    mesh = sphere(2)
    texture = unrolled(mesh)
    bare = texture.uv.copy()
    bare[5] = np.nan
    along = onto(mesh, mesh)
    faces = np.where(np.arange(mesh.n_vertices) == 40, -1, along.faces)
    gap = BarycentricMap(faces, along.weights, mesh.faces, mesh.n_vertices)
    found = pull_texture(Textured(mesh, bare, texture.images), gap, mesh, mesh)
    without = (mesh.faces == 40).any(1) | (np.arange(mesh.n_faces) == 5)
    np.testing.assert_array_equal(np.isnan(found.uv).any((1, 2)), without)
    np.testing.assert_array_equal(found.image_numbers, np.where(without, -1, 0))


def test_every_face_has_the_image_of_where_its_centre_lands():
    mesh = sphere(3)
    north = (mesh.corners[..., 2].mean(1) > 0).astype(int)
    flat = Textured(mesh, mesh.corners[..., :2], (picture(), Image(".jpg", b"j")), north)
    rough = sphere(2)
    found = pull_texture(flat, onto(rough, mesh), rough, mesh)
    centre = rough.corners[..., 2].mean(1)
    clear = np.abs(centre) > 0.1
    np.testing.assert_array_equal(found.image_numbers[clear], centre[clear] > 0)
    np.testing.assert_allclose(found.uv, rough.corners[..., :2], atol=0.03)


def test_the_texture_of_another_mesh_is_refused():
    with pytest.raises(DataError, match="match the file that has the texture"):
        pull_texture(unrolled(sphere(1)), onto(sphere(2), sphere(2)), sphere(2), sphere(2))


def test_a_file_is_carried_over_to_a_file(tmp_path):
    fine, rough = cylinder(n=48, m=30), cylinder(n=17, m=21)
    write_textured(tmp_path / "fine.obj", unrolled(fine))
    found = pull_texture(read_textured(tmp_path / "fine.obj"), onto(rough, fine), rough, fine)
    write_textured(tmp_path / "rough.obj", found)
    again = read_textured(tmp_path / "rough.obj")
    np.testing.assert_array_equal(again.uv, found.uv)
    assert again.images == (picture(),)
