from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from csm.errors import ConfigError, MeshError
from csm.mesh.check import check
from csm.mesh.clean import clean
from csm.mesh.io import read_mesh, read_polygons
from csm.mesh.polygons import PolygonMesh
from csm.mesh.shape import Mesh
from tests.mesh.test_debris import scattered
from tests.mesh.test_mending import soup
from tests.shapes import blob, plane, torus

CASES = Path(__file__).parent.parent / "cases"


@pytest.fixture(scope="module")
def spot() -> Mesh:
    return read_mesh(CASES / "spot_reference.obj")


def same_surface(a: Mesh, b: Mesh) -> None:
    """The same triangles at the same places, oriented alike, in whatever order."""
    for mesh in (a, b):
        assert {f.severity for f in check(mesh)} <= {"note"}
    corners = [np.sort(np.round(m.corners.mean(axis=1), 9).view("f8,f8,f8"), axis=0) for m in (a, b)]
    np.testing.assert_array_equal(*corners)
    assert np.sign(np.einsum("ij,ij->", a.corners[:, 0], a.face_crosses)) == np.sign(
        np.einsum("ij,ij->", b.corners[:, 0], b.face_crosses)
    )


def test_a_sound_mesh_is_returned_as_it_is(spot):
    done = clean(spot)
    assert done.mesh is spot
    assert done.mends == ()
    assert done.text == ""
    assert (done.vertex_map == np.arange(spot.n_vertices)).all()


@pytest.mark.parametrize(
    ("case", "kinds"),
    [
        ("spot_inside_out.off", ["orient"]),
        ("spot_random_face_orientation.off", ["orient"]),
        ("spot_split_at_seam.off", ["weld"]),
        ("spot_isolated_vertex.off", ["unreferenced"]),
        ("spot_with_300_debris_triangles.off", ["debris"]),
    ],
)
def test_a_spoilt_spot_is_spot_again_and_its_map_says_which_vertex_is_which(spot, case, kinds):
    given = read_mesh(CASES / case)
    done = clean(given)
    assert [mend.kind for mend in done.mends] == kinds
    assert done.mesh.n_vertices == spot.n_vertices
    same_surface(done.mesh, spot)
    assert check(done.mesh) == ()
    kept = np.flatnonzero(done.vertex_map >= 0)
    np.testing.assert_array_equal(done.mesh.vertices[done.vertex_map[kept]], given.vertices[kept])
    np.testing.assert_array_equal(given.vertices[done.origin], done.mesh.vertices)
    assert (done.vertex_map[done.origin] == np.arange(done.mesh.n_vertices)).all()


def test_a_soup_with_everything_wrong_becomes_the_mesh_it_was():
    mesh = blob(3)
    loose, _ = scattered(mesh, 20, 1e-3)
    broken = soup(loose)
    faces = broken.faces.copy()
    turned = np.random.default_rng(0).random(len(faces)) < 0.4
    faces[turned] = faces[turned][:, ::-1]
    done = clean(Mesh(broken.vertices, np.vstack([faces, faces[:3]])))
    assert {mend.kind for mend in done.mends} == {"weld", "faces", "debris", "orient"}
    same_surface(done.mesh, mesh)


def test_every_step_can_be_left_out():
    mesh = soup(blob(2))
    done = clean(mesh, weld=False, debris=0)
    assert done.mesh is mesh
    turned = Mesh(blob(2).vertices, blob(2).faces[:, ::-1])
    assert clean(turned, orient=False).mesh is turned
    assert clean(scattered(blob(2), 4, 1e-3)[0], debris=0).mesh.n_vertices == blob(2).n_vertices + 12


def test_polygons_are_triangulated_and_the_face_map_names_them():
    a, b, n = 8, 5, 40
    corners = np.array([[i * (b + 1) + j for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]], dtype=int)
    x, y = (v.ravel() for v in np.meshgrid(np.arange(a + 1.0), np.arange(b + 1.0), indexing="ij"))
    quads = np.concatenate([corners + i * (b + 1) + j for i in range(a) for j in range(b)])
    flat = PolygonMesh(np.stack([x, y, 0 * x], 1), quads.ravel(), np.full(n, 4))
    done = clean(flat)
    assert done.mends[0].text == "40 polygons triangulated"
    assert done.mesh.n_faces == 2 * n
    assert done.mesh.area == pytest.approx(n)
    assert (np.sort(done.face_map) == np.repeat(np.arange(n), 2)).all()


def test_what_was_cut_apart_is_not_welded_again():
    square = plane(6)
    inner, rim = [14, 15], [0, 1]
    fins = np.vstack([square.vertices, square.vertices[[inner[0], rim[0]]] + [0, 0, 1.0], [[-1, -1, 0], [-1, 0, 0]]])
    faces = np.vstack([square.faces, [[*inner, 36], [*rim, 37], [*rim[::-1], 37], [rim[0], 38, 39], [14, 8, 36]]])
    once = clean(Mesh(fins, faces))
    assert "split" in {mend.kind for mend in once.mends}
    again = clean(once.mesh)
    assert again.mesh is once.mesh
    assert again.mends == ()


def test_a_one_sided_mesh_is_not_said_to_be_changed():
    t = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rims = [
        np.stack([(2 + s * np.cos(t / 2)) * np.cos(t), (2 + s * np.cos(t / 2)) * np.sin(t), s * np.sin(t / 2)], 1)
        for s in (-1, 1)
    ]
    a, b = np.arange(24), np.arange(24) + 24
    c, d = np.r_[a[1:], b[0]], np.r_[b[1:], a[0]]
    done = clean(Mesh(np.vstack(rims), np.vstack([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])))
    assert clean(done.mesh).changes == ()
    assert [mend.kind for mend in clean(done.mesh).mends] == ["one_sided"]


def test_vertices_with_flat_faces_only_are_joined_with_a_neighbour():
    square = plane(6)
    spike = np.vstack([square.vertices, square.vertices[14]])
    faces = np.vstack([square.faces, [[14, 15, 36], [15, 14, 36]]])
    done = clean(Mesh(spike, faces))
    assert done.vertex_map[36] == done.vertex_map[14]
    assert not [f for f in check(done.mesh) if f.severity == "error"]


@pytest.mark.parametrize(
    ("faces", "said"),
    [([[0, 1, 1], [2, 2, 0]], "all of its 2 faces vanish"), ([[0, 1, 2]], "its only face vanishes")],
)
def test_a_mesh_of_which_no_surface_is_left_is_refused_with_the_reason(faces, said):
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    with pytest.raises(MeshError, match=said):
        clean(Mesh(line, np.array(faces)))


def test_a_mesh_whose_areas_underflow_is_called_too_small():
    ball = blob(2)
    tiny = Mesh(1e-200 * ball.vertices, ball.faces)
    with pytest.raises(MeshError, match=r"all of its 320 faces vanish: the mesh is only .*e-200 wide.*scale it up"):
        clean(tiny)
    (found,) = [finding for finding in check(tiny) if finding.severity == "error"]
    assert "e-200 wide" in found.text
    with pytest.raises(MeshError, match="too small"):
        clean(Mesh(1e-90 * ball.vertices, ball.faces))
    assert clean(Mesh(1e-60 * ball.vertices, ball.faces)).mends == ()


def test_labels_carry_over():
    mesh = torus()
    loose = soup(mesh)
    done = clean(loose)
    assert done.carried(loose.vertices) == pytest.approx(done.mesh.vertices)


@pytest.mark.parametrize("options", [{"debris": -0.1}, {"debris": 1.0}, {"tolerance": float("nan")}])
def test_fractions_out_of_range_are_refused(options):
    with pytest.raises(ConfigError, match=next(iter(options))):
        clean(blob(2), **options)


def test_a_file_of_quads_is_cleaned(tmp_path):
    (tmp_path / "cube.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
        + "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    )
    done = clean(read_polygons(tmp_path / "cube.obj"))
    assert done.mesh.area == pytest.approx(6)
    assert check(done.mesh) == ()
