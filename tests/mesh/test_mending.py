import numpy as np
import pytest

from csm.mesh.check import check
from csm.mesh.mending import collapsed, joined_short_edges, sound_faces, split, turns, welded
from csm.mesh.shape import Mesh
from tests.shapes import blob, cylinder, plane, sphere, torus


def soup(mesh: Mesh) -> Mesh:
    return Mesh(mesh.corners.reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3), "soup")


def kinds(vertices, faces):
    return {finding.kind for finding in check(Mesh(vertices, faces))}


@pytest.mark.parametrize("mesh", [blob(3), torus(), cylinder()], ids=lambda m: m.name)
def test_a_soup_is_welded_to_the_surface_it_came_from(mesh):
    loose = soup(mesh)
    first = welded(loose.vertices, loose.faces, 1e-7)
    assert len(np.unique(first)) == mesh.n_vertices
    assert (loose.vertices[first] == loose.vertices).all()
    assert (first <= np.arange(len(first))).all()


def test_close_corners_are_welded_within_the_tolerance_only():
    loose = soup(blob(3))
    rng = np.random.default_rng(0)
    shaken = loose.vertices + 1e-9 * rng.normal(size=loose.vertices.shape)
    assert len(np.unique(welded(shaken, loose.faces, 1e-7))) == blob(3).n_vertices
    assert len(np.unique(welded(shaken, loose.faces, 0))) == len(shaken)


def test_closed_parts_that_touch_stay_apart():
    ball = sphere(2)
    twice = np.vstack([ball.faces, ball.faces + ball.n_vertices])
    both = np.vstack([ball.vertices, ball.vertices])
    assert (welded(both, twice, 1e-7) == np.arange(len(both))).all()


def test_open_parts_that_meet_in_a_vertex_or_at_an_inner_edge_stay_apart():
    square = plane(5)
    corner = np.vstack([square.vertices, square.vertices - [1, 1, 0]])
    twice = np.vstack([square.faces, square.faces + 25])
    assert (welded(corner, twice, 1e-7) == np.arange(50)).all()
    fin = np.vstack([square.vertices, square.vertices[[6, 7]], square.vertices[6] + [0, 0, 1.0]])
    assert (welded(fin, np.vstack([square.faces, [[25, 26, 27]]]), 1e-7) == np.arange(28)).all()
    beside = np.vstack([square.vertices, square.vertices + np.array([1, 0, 0])])
    assert len(np.unique(welded(beside, twice, 1e-7))) == 45


def test_sound_faces_have_three_corners_once():
    faces = np.array([[0, 1, 2], [2, 1, 0], [1, 1, 3], [1, 3, 2], [0, 1, 2]])
    assert sound_faces(faces).tolist() == [True, False, False, True, False]


def test_a_vertex_of_flat_faces_only_is_joined_with_its_neighbour():
    square = plane(5)
    spike = np.vstack([square.vertices, square.vertices[7]])
    faces = np.vstack([square.faces, [[7, 8, 25], [8, 7, 25]]])
    flat = np.r_[np.zeros(square.n_faces, bool), True, True]
    target = collapsed(spike, faces, flat)
    assert target[25] == 7
    assert (target[:25] == np.arange(25)).all()


def test_a_fin_is_cut_off_and_the_body_stays_whole():
    square = plane(6)
    inner = next(
        (a, b) for a, b in square.faces[:, :2].tolist() if {a, b}.isdisjoint(np.flatnonzero(_border(square)).tolist())
    )
    vertices = np.vstack([square.vertices, square.vertices[inner[0]] + [0, 0, 1.0]])
    faces = np.vstack([square.faces, [[*inner, square.n_vertices]]])
    assert "non_manifold_edges" in kinds(vertices, faces)
    new, origin = split(vertices, faces)
    assert (new[:-1] == faces[:-1]).all(), "the body keeps its numbers"
    assert (origin[new] == faces).all()
    assert not kinds(vertices[origin], new) & {"non_manifold_edges", "non_manifold_vertices"}


def _border(mesh):
    border = np.zeros(mesh.n_vertices, bool)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    border[(x == 0) | (x == 1) | (y == 0) | (y == 1)] = True
    return border


def test_two_cubes_that_share_an_edge_are_parted_into_two_cubes():
    import trimesh

    box = trimesh.creation.box()
    vertices = np.vstack([box.vertices, np.asarray(box.vertices) + np.array([1, 1, 0])])
    _, first, inverse = np.unique(vertices.round(9), axis=0, return_index=True, return_inverse=True)
    faces = np.asarray(inverse).ravel()[np.vstack([box.faces, np.asarray(box.faces) + len(box.vertices)])]
    new, origin = split(vertices[first], faces)
    assert len(origin) == 16
    assert kinds(vertices[first][origin], new) == {"several_components", "duplicate_vertices"}


def test_a_pinched_vertex_gets_a_copy_per_fan():
    a, b = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[-1.0, 0, 0], [0, -1, 0]])
    faces = np.array([[0, 1, 2], [0, 3, 4]])
    new, origin = split(np.vstack([a, b]), faces)
    assert new[0].tolist() == [0, 1, 2]
    assert sorted(origin.tolist()) == [0, 0, 1, 2, 3, 4]


def test_a_manifold_is_not_cut():
    mesh = torus()
    new, origin = split(mesh.vertices, mesh.faces)
    assert (new == mesh.faces).all()
    assert (origin == np.arange(mesh.n_vertices)).all()


@pytest.mark.parametrize("mesh", [blob(3), torus(), cylinder(), plane()], ids=lambda m: m.name)
def test_faces_turned_at_random_are_turned_back(mesh):
    turned = np.random.default_rng(3).random(mesh.n_faces) < 0.3
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    assert (turns(mesh.vertices, faces).flip == turned).all()


def test_a_closed_surface_inside_out_is_turned_and_an_open_one_stays():
    ball, tube = blob(3), cylinder()
    found = turns(ball.vertices, ball.faces[:, ::-1])
    assert found.flip.all()
    assert found.n_inside_out == 1
    assert not turns(tube.vertices, tube.faces[:, ::-1]).flip.any()


def test_a_closed_surface_with_a_small_hole_counts_as_closed():
    ball = blob(3)
    assert turns(ball.vertices, ball.faces[1:, ::-1]).flip.all()


def test_a_cavity_stays_oriented_inwards():
    ball = sphere(3)
    vertices = np.vstack([ball.vertices, 0.5 * ball.vertices])
    faces = np.vstack([ball.faces, ball.faces[:, ::-1] + ball.n_vertices])
    assert not turns(vertices, faces).flip.any()


def test_a_moebius_strip_is_left_as_it_is():
    n = 20
    u = np.linspace(0, 2 * np.pi, n, endpoint=False)

    def edge(s):
        r = 2 + s * np.cos(u / 2)
        return np.stack([r * np.cos(u), r * np.sin(u), s * np.sin(u / 2)], 1)

    i, j = np.arange(n), (np.arange(n) + 1) % n
    a, b = np.where(j, j, n), np.where(j, n + j, 0)  # the strip closes with its sides exchanged
    faces = np.vstack([np.stack([i, a % (2 * n), n + i], 1), np.stack([a % (2 * n), b, n + i], 1)])
    found = turns(np.vstack([edge(1.0), edge(-1.0)]), faces)
    assert found.n_one_sided == 1
    assert not found.flip.any()


def test_ends_of_edges_of_no_length_are_joined():
    square = plane(6)
    vertices = np.vstack([square.vertices, square.vertices[14]])
    face = next(i for i, f in enumerate(square.faces) if 14 in f)
    faces = np.vstack([square.faces, [[14, 36, square.faces[face][(list(square.faces[face]).index(14) + 1) % 3]]]])
    target = joined_short_edges(vertices, faces)
    assert target[36] == 14
    assert (target[:36] == np.arange(36)).all()


def test_a_loose_face_all_of_whose_corners_are_in_one_place_is_welded_to_nothing():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float)
    tiny = corners[1] + 1e-7 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    soup = np.vstack([corners[[0, 1, 2]], corners[[2, 1, 3]], tiny])
    first = welded(soup, np.arange(9).reshape(3, 3), 1e-5)
    assert len(set(first[6:])) == 1
    assert len(set(first[:6])) == 4
