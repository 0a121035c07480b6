from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.shape import Mesh
from tests.shapes import blob, plane, rotation, sphere

TRIANGLE = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]])


def test_areas_and_normals_of_a_right_triangle():
    mesh = Mesh(TRIANGLE, [[0, 1, 2]])
    assert mesh.area == 6.0
    np.testing.assert_array_equal(mesh.face_crosses, [[0, 0, 12]])
    np.testing.assert_array_equal(mesh.corners, TRIANGLE[None])
    assert (mesh.n_vertices, mesh.n_faces) == (3, 1)


def test_area_of_known_surfaces():
    assert sphere(4, radius=2.0).area == pytest.approx(16 * np.pi, rel=5e-3)
    assert plane().area == pytest.approx(np.prod(np.ptp(plane().vertices, axis=0)[:2]))


def test_vertex_normals_of_a_sphere_point_outwards_and_a_loose_vertex_has_none():
    mesh = sphere(3)
    assert (mesh.vertex_normals * mesh.vertices).sum(axis=1).min() > 0.999
    loose = Mesh(np.vstack([TRIANGLE, [5, 5, 5]]), [[0, 1, 2]])
    np.testing.assert_array_equal(loose.vertex_normals, [[0, 0, 1]] * 3 + [[0, 0, 0]])


def test_nothing_can_be_changed_afterwards_not_even_through_the_arrays_given():
    vertices = TRIANGLE.copy()
    mesh = Mesh(vertices, [[0, 1, 2]])
    vertices[0] = 9
    assert mesh.vertices[0].tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        mesh.name = "other"


def test_unit_area_keeps_the_shape_and_the_way_back():
    mesh = blob()
    scaled = mesh.unit_area()
    assert scaled.area == pytest.approx(1)
    np.testing.assert_allclose(scaled.vertices * scaled.scale, mesh.vertices)
    again = scaled.unit_area()
    assert again.scale == pytest.approx(scaled.scale)


def test_a_surface_without_area_cannot_be_scaled():
    with pytest.raises(MeshError, match=r"flat: .*area is 0\.0.*csm check"):
        Mesh(np.zeros((3, 3)), [[0, 1, 2]], "flat").unit_area()


def test_the_digest_is_of_the_geometry_alone():
    mesh = blob()
    assert Mesh(mesh.vertices, mesh.faces, "another name").digest == mesh.digest
    assert Mesh(np.asfortranarray(mesh.vertices), mesh.faces.astype(np.int32)).digest == mesh.digest
    moved, turned = mesh.vertices.copy(), mesh.vertices @ rotation().T
    moved[5, 1] = np.nextafter(moved[5, 1], np.inf)
    others = [Mesh(moved, mesh.faces), Mesh(turned, mesh.faces), Mesh(mesh.vertices, mesh.faces[::-1])]
    assert len({mesh.digest, *(other.digest for other in others)}) == 4


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (TRIANGLE[:, :2], [[0, 1, 2]], r"bad: vertices have shape \(3, 2\), wanted \(N, 3\)"),
        (TRIANGLE, [[0, 1, 2, 0]], r"bad: faces have shape \(1, 4\).*triangle"),
        (TRIANGLE, [[0, 1, 2], [0, 1, 7]], r"face 1 refers to vertex 7, but there are 3 \(0\.\.2\)$"),
        (TRIANGLE, [[0, -1, 2]], "face 0 refers to vertex -1"),
        (TRIANGLE, [[1, 2, 3]], "1-based"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices, faces, message):
    with pytest.raises(MeshError, match=message):
        Mesh(vertices, faces, "bad")


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (TRIANGLE, [[0, 1, 1.5]], "faces hold 1.5, wanted whole numbers"),
        (TRIANGLE, [[0, 1, np.nan]], "faces hold nan, wanted whole numbers"),
        (TRIANGLE, [[False, True, True]], "faces are truth values"),
        (TRIANGLE, np.array([[0, 1, 2j]]), "faces are complex"),
        (TRIANGLE, [["0", "1", "2"]], "faces are of the kind <U1"),
        (TRIANGLE, np.array([[0, 1, 2**64 - 1]], np.uint64), "face 0 refers to vertex 9223372036854775807"),
        (TRIANGLE * 1j, [[0, 1, 2]], r"vertices are complex \(the imaginary part would be lost\)"),
        (TRIANGLE > 0, [[0, 1, 2]], "vertices are truth values"),
        (TRIANGLE.astype(object), [[0, 1, 2]], "vertices are Python objects"),
        ([[0, 0, 0], [1, 0]], [[0, 1, 2]], "vertices form no array of numbers"),
    ],
)
def test_numbers_of_another_kind_are_refused_not_rounded(vertices, faces, message):
    with pytest.raises(MeshError, match=f"^thing: {message}"):
        Mesh(vertices, faces, "thing")


def test_whole_numbers_of_any_type_are_faces():
    for kind in (np.uint8, np.uint64, np.float32, np.float64):
        assert Mesh(TRIANGLE, np.array([[0, 2, 1]], kind)).faces.tolist() == [[0, 2, 1]]
