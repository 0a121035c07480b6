import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from csm.errors import MeshError
from csm.mesh.polygons import PolygonMesh, triangulated
from tests.shapes import blob, rotation

SQUARE = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def polygon(points, *faces, **more) -> PolygonMesh:
    faces = faces or (range(len(points)),)
    return PolygonMesh(points, [i for f in faces for i in f], [len(f) for f in faces], **more)


def enclosed(points: np.ndarray) -> float:
    """Area of a polygon in the plane by the shoelace formula."""
    x, y = np.asarray(points)[:, 0], np.asarray(points)[:, 1]
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_a_triangle_mesh_comes_back_as_it_was():
    mesh = blob(1)
    back = PolygonMesh.of(mesh).triangles()
    assert back.digest == mesh.digest
    assert triangulated(PolygonMesh.of(mesh)).mesh.digest == mesh.digest


def test_arrays_are_read_only_copies():
    points = np.array(SQUARE)
    made = polygon(points)
    points[:] = 7
    assert made.vertices.max() == 1
    assert not any(a.flags.writeable for a in (made.vertices, made.corners, made.sizes))


REFUSED = {
    "two columns": (([[0, 0]], [0, 0, 0], [3]), "wanted \\(N, 3\\)"),
    "sizes": ((SQUARE, [0, 1, 2], [4]), "which of|how many of them"),
    "negative size": ((SQUARE, [0, 1, 2], [4, -1]), "how many of them"),
    "outside": ((SQUARE, [0, 1, 2, 0, 1, 9], [3, 3]), "face 1 refers to vertex 9, but there are 4"),
    "before": ((SQUARE, [0, 1, -2], [3]), "face 0 refers to vertex -2"),
    "1-based": ((SQUARE, [1, 2, 3, 4], [4]), "1-based: subtract 1"),
    "no vertices": ((np.zeros((0, 3)), [0, 0, 0], [3]), "but there is none"),
    "fractions": ((SQUARE, [0, 1, 1.5], [3]), "faces hold 1.5, wanted whole"),
    "complex": ((np.array(SQUARE) * 1j, [0, 1, 2], [3]), "imaginary part would be lost"),
    "truth": ((SQUARE, [True, False, True], [3]), "truth values"),
    "text": ((SQUARE, ["0", "1", "2"], [3]), "of the kind <U1"),
    "ragged": (([[0, 0, 0], [1]], [0, 0, 0], [3]), "form no array"),
}


@pytest.mark.parametrize(("arrays", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_mesh_is_refused_by_name(arrays, message):
    with pytest.raises(MeshError, match=f"^here.off: .*({message})"):
        PolygonMesh(*arrays, name="here", source="here.off")


def test_polygons_ask_for_clean_with_the_file_as_given():
    with pytest.raises(MeshError, match=r"^\./q\.off: face 1 has 4 corners \(1 of 2 faces.*`csm clean`"):
        polygon(SQUARE, [0, 1, 2], [0, 1, 2, 3], source="./q.off").triangles()


def test_a_convex_quad_is_split_along_its_shorter_diagonal():
    kite = [[0.0, 0, 0], [1, -3, 0], [2, 0, 0], [1, 3, 0]]
    assert triangulated(polygon(kite)).mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    turned = kite[1:] + kite[:1]
    assert triangulated(polygon(turned)).mesh.faces.tolist() == [[0, 1, 3], [1, 2, 3]]


def test_a_dart_is_split_where_its_triangles_agree_though_that_diagonal_is_longer():
    dart = [[0.0, 0, 0], [4, -1, 0], [1, 0, 0], [4, 1, 0]]
    mesh = triangulated(polygon(dart)).mesh
    assert mesh.area == pytest.approx(enclosed(dart))
    assert (mesh.face_crosses[:, 2] > 0).all()


@st.composite
def stars(draw):
    """Simple polygons around the origin, most of them not convex, some with corners on straight lines."""
    n = draw(st.integers(4, 14))
    radii = np.array(draw(st.lists(st.floats(0.05, 1.0), min_size=n, max_size=n)))
    angles = np.arange(n) * 2 * np.pi / n
    ring = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    if draw(st.booleans()):
        ring = np.stack([ring, (ring + np.roll(ring, -1, axis=0)) / 2], axis=1).reshape(-1, 2)
    return ring


@settings(max_examples=150, deadline=None)
@given(ring=stars(), seed=st.integers(0, 100), clockwise=st.booleans())
def test_flat_simple_polygons_keep_their_area_and_orientation_anywhere_in_space(ring, seed, clockwise):
    points = np.column_stack([ring, np.zeros(len(ring))])[:: -1 if clockwise else 1] @ rotation(seed).T + 5
    made = triangulated(polygon(points))
    normal = rotation(seed)[:, 2] * (-1 if clockwise else 1)
    assert made.mesh.n_faces == len(ring) - 2
    assert made.mesh.area == pytest.approx(enclosed(ring), rel=1e-9)
    assert (made.mesh.face_crosses @ normal > -1e-9).all()
    np.testing.assert_array_equal(made.mesh.vertices, points)


def test_a_spiral_keeps_its_area():
    turns = np.linspace(0, 6 * np.pi, 80)
    outer = np.stack([(turns + 2) * np.cos(turns), (turns + 2) * np.sin(turns)], axis=1)
    ring = np.concatenate([outer, 0.9 * outer[::-1]])
    points = np.column_stack([ring, np.zeros(len(ring))])
    assert triangulated(polygon(points)).mesh.area == pytest.approx(abs(enclosed(ring)))


def test_the_face_map_names_the_polygon_of_each_triangle_in_order():
    pentagon = [[np.cos(a), np.sin(a), 0] for a in np.arange(5) * 2 * np.pi / 5]
    made = triangulated(polygon(pentagon, [0, 1], [0, 1, 2], [0, 1, 2, 3, 4], [], [0, 1, 2, 3], [2, 3, 4]))
    assert made.face_map.tolist() == [1, 2, 2, 2, 4, 4, 5]
    assert made.mesh.notes == ("2 faces have fewer than three corners and were left out",)
    assert made.mesh.n_vertices == 5


def test_a_quad_that_names_a_vertex_twice_is_a_triangle_and_that_is_noted():
    made = triangulated(polygon(SQUARE, [0, 1, 2, 2], [3, 0, 2, 3], notes=("read",)))
    assert made.mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert made.mesh.notes[0] == "read"
    assert "2 polygons name a vertex twice in a row" in made.mesh.notes[1]


def test_a_polygon_that_crosses_itself_is_split_and_noted():
    eight = [[0.0, 0, 0], [2, 2, 0], [2, 1, 0], [2, 0, 0], [0, 2, 0], [0, 1, 0]]
    made = triangulated(polygon(eight, [0, 1, 2], range(6)))
    assert made.mesh.n_faces == 5
    assert "the first of them face 1, cannot be split cleanly" in made.mesh.notes[0]


def test_many_convex_polygons_are_split_in_one_go():
    """100 000 hexagons: a loop over them would take half a minute."""
    hexagon = np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3])
    made = triangulated(PolygonMesh(hexagon, np.tile(np.arange(6), 10**5), np.full(10**5, 6)))
    assert made.mesh.area == pytest.approx(10**5 * 1.5 * np.sqrt(3))


def test_an_empty_mesh_stays_empty():
    made = triangulated(PolygonMesh(np.zeros((0, 3)), [], []))
    assert (made.mesh.n_vertices, made.mesh.n_faces, len(made.face_map)) == (0, 0, 0)
