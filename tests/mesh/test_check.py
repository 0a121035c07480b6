import time

import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.check import check, require_usable
from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh
from tests.shapes import blob, cylinder, plane, rotation, sphere, torus


def kinds(mesh):
    return {finding.kind: finding for finding in check(mesh)}


def joined(*meshes):
    offsets = np.cumsum([0, *(m.n_vertices for m in meshes)])
    faces = [m.faces + o for m, o in zip(meshes, offsets, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces), "joined")


def moved(mesh, by):
    return Mesh(mesh.vertices + by, mesh.faces)


@pytest.mark.parametrize("mesh", [sphere(2), torus(), blob(3)], ids=lambda m: m.name)
def test_closed_manifolds_have_no_findings(mesh):
    assert check(mesh) == ()
    require_usable(mesh)


@pytest.mark.parametrize(("mesh", "n"), [(cylinder(n=24), 48), (plane(n=15), 56)], ids=["cylinder", "plane"])
def test_boundary_edges_are_counted(mesh, n):
    found = kinds(mesh)
    assert set(found) == {"boundary"}
    assert found["boundary"].count == n
    assert found["boundary"].severity == "note"


def test_unreferenced_vertices_are_counted_and_take_no_part():
    ball = sphere(2)
    mesh = Mesh(np.insert(ball.vertices, [3, 10], 5.0, axis=0), np.where(ball.faces >= 3, ball.faces + 1, ball.faces))
    mesh = Mesh(mesh.vertices, np.where(mesh.faces >= 11, mesh.faces + 1, mesh.faces), "holed")
    found = kinds(mesh)["unreferenced_vertices"]
    assert (found.count, found.first, found.severity) == (2, (3, 11), "note")
    require_usable(mesh)


def test_unreferenced_vertices_may_have_any_place():
    ball = sphere(2)
    lost = Mesh(np.vstack([ball.vertices, [[np.nan, 0, 0]]]), ball.faces)
    assert set(kinds(lost)) == {"unreferenced_vertices"}
    require_usable(lost)


def test_small_components_are_named_as_debris():
    ball = sphere(2)
    speck = Mesh(0.01 * ball.vertices + 3, ball.faces)
    found = kinds(joined(ball, speck, moved(ball, 5)))["debris"]
    assert (found.count, found.first, found.severity) == (1, (ball.n_vertices,), "note")
    assert "debris" not in kinds(joined(ball, moved(ball, 5)))


def test_duplicate_vertices_name_the_later_ones():
    ball = sphere(2)
    mesh = joined(ball, ball)
    found = kinds(mesh)
    assert found["duplicate_vertices"].count == ball.n_vertices
    assert found["duplicate_vertices"].first == tuple(range(ball.n_vertices, ball.n_vertices + 5))
    assert found["several_components"].first == (0, ball.n_vertices)
    require_usable(mesh)


def test_duplicate_faces_in_any_rotation_and_orientation():
    ball = sphere(2)
    mesh = Mesh(ball.vertices, np.concatenate([ball.faces, ball.faces[[4]][:, [1, 2, 0]], ball.faces[[7]][:, ::-1]]))
    found = kinds(mesh)["duplicate_faces"]
    assert (found.count, found.first) == (2, (ball.n_faces, ball.n_faces + 1))


def test_zero_area_faces_by_repetition_and_by_collinearity():
    ball = sphere(2)
    a, b = ball.faces[0, :2]
    on_edge = 0.5 * (ball.vertices[a] + ball.vertices[b])
    mesh = Mesh([*ball.vertices, on_edge], [*ball.faces, [0, 0, 1], [a, b, ball.n_vertices]])
    found = kinds(mesh)
    assert found["zero_area_faces"].first == (ball.n_faces, ball.n_faces + 1)
    assert found["zero_area_faces"].severity == "note"
    assert found["massless_vertices"].first == (ball.n_vertices,)
    with pytest.raises(MeshError, match="zero area only"):
        require_usable(mesh)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_zero_area_does_not_depend_on_scale(scale):
    ball = sphere(2)
    assert "zero_area_faces" not in kinds(Mesh(ball.vertices * scale, ball.faces))


def test_no_surface_at_all():
    assert kinds(Mesh(np.zeros((3, 3)), [[0, 1, 2]]))["zero_total_area"].severity == "error"
    assert kinds(Mesh(np.eye(3), np.zeros((0, 3), int)))["no_faces"].severity == "error"


def test_non_finite_coordinates_come_first_and_alone_name_vertices():
    ball = sphere(2)
    vertices = ball.vertices.copy()
    vertices[[5, 9], 1] = np.nan, np.inf
    found = check(Mesh(vertices, ball.faces))
    assert (found[0].kind, found[0].first, found[0].severity) == ("non_finite", (5, 9), "error")
    with pytest.raises(MeshError, match="not finite"):
        require_usable(Mesh(vertices, ball.faces))


def test_three_faces_at_one_edge():
    mesh = Mesh([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    found = kinds(mesh)
    assert found["non_manifold_edges"].count == 1
    assert found["non_manifold_edges"].first[0] in (0, 1)
    assert "non_manifold_vertices" not in found  # the three faces share the edge, so each end has one fan


def test_two_balls_that_share_a_vertex():
    a = sphere(2)
    b = moved(a, 2 * a.vertices[0])
    index = np.arange(b.n_vertices) + a.n_vertices - 1
    touching = int(np.argmin(np.linalg.norm(b.vertices - a.vertices[0], axis=1)))
    index[: touching + 1] += 1
    index[touching] = 0
    mesh = Mesh(
        np.concatenate([a.vertices, np.delete(b.vertices, touching, axis=0)]), np.concatenate([a.faces, index[b.faces]])
    )
    found = kinds(mesh)
    assert set(found) == {"non_manifold_vertices"}
    assert (found["non_manifold_vertices"].count, found["non_manifold_vertices"].first) == (1, (0,))


def fans_by_walking(mesh):
    """Count the fans at each vertex the slow way: merge faces that share an edge at the vertex."""
    split = []
    for vertex in range(mesh.n_vertices):
        groups = [set(face) - {vertex} for face in mesh.faces.tolist() if vertex in face]
        merged = []
        for group in groups:
            touching = [g for g in merged if g & group]
            merged = [g for g in merged if not g & group] + [group.union(*touching)]
        if len(merged) > 1:
            split.append(vertex)
    return split


@pytest.mark.parametrize("seed", range(8))
def test_manifoldness_against_brute_force_and_trimesh(seed):
    rng = np.random.default_rng(seed)
    ball = blob(1)
    faces = ball.faces[rng.random(ball.n_faces) < 0.6]
    faces = np.concatenate([faces, rng.permuted(np.stack([rng.permutation(ball.n_vertices)[:3] for _ in range(4)]))])
    faces = faces[(np.sort(faces, axis=1)[:, 1:] != np.sort(faces, axis=1)[:, :-1]).all(axis=1)]
    mesh = Mesh(ball.vertices, faces)
    found = kinds(mesh)
    split = fans_by_walking(mesh)
    assert (found["non_manifold_vertices"].count if split else 0) == len(split)
    if split:
        assert found["non_manifold_vertices"].first == tuple(split[:5])
    uses = np.unique(
        np.sort(trimesh.Trimesh(mesh.vertices, faces, process=False).edges, axis=1), axis=0, return_counts=True
    )[1]
    assert found["boundary"].count == (uses == 1).sum()
    assert ("non_manifold_edges" in found) == bool((uses > 2).any())
    if (uses > 2).any():
        assert found["non_manifold_edges"].count == (uses > 2).sum()


def test_a_turned_face_is_oriented_against_its_three_neighbours():
    ball = sphere(2)
    faces = ball.faces.copy()
    faces[17] = faces[17, ::-1]
    found = kinds(Mesh(ball.vertices, faces))
    assert set(found) == {"inconsistent_orientation"}
    assert found["inconsistent_orientation"].count == 3
    assert set(found["inconsistent_orientation"].first) <= set(faces[17].tolist())


def test_inside_out_wherever_the_mesh_is():
    ball = sphere(2)
    turned = Mesh(ball.vertices @ rotation().T + 1000.0, ball.faces[:, ::-1])
    assert set(kinds(turned)) == {"inside_out"}
    assert check(moved(ball, -1000.0)) == ()


@pytest.mark.parametrize(("scale", "kind"), [(1e-6, "tiny_scale"), (1e6, "huge_scale")])
def test_scales_out_of_the_ordinary(scale, kind):
    ball = sphere(2)
    assert set(kinds(Mesh(ball.vertices * scale, ball.faces))) == {kind}


def test_findings_do_not_change_with_the_order_of_faces():
    mesh = joined(cylinder(), moved(sphere(1), 7.0), plane(6))
    shuffled = Mesh(mesh.vertices, np.random.default_rng(0).permutation(mesh.faces))
    assert {(f.kind, f.count, f.first) for f in check(mesh)} == {(f.kind, f.count, f.first) for f in check(shuffled)}


def test_fast_enough_for_fifteen_thousand_vertices():
    mesh = torus(n=150, m=100)
    begun = time.process_time()
    check(mesh)
    assert time.process_time() - begun < 0.3  # measured: 0.05 s


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "file", "expected"),
    [
        ("FAUST_6890", "shapes/tr_reg_000.mat", set()),
        ("FAUST_15000", "tr_reg_080.off", set()),
        ("SHREC19_5k_remeshed", "40.obj", {"boundary"}),
        ("TOSCA_5k_remeshed", "vtx_5k/victoria10.off", {"boundary"}),
        ("SCAPE_5000", "shapes/mesh007.mat", {"duplicate_vertices"}),
    ],
)
def test_real_meshes(data_set, name, file, expected):
    mesh = read_mesh(data_set(name) / file)
    assert set(kinds(mesh)) == expected
    require_usable(mesh)
