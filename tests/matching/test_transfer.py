from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.errors import ConfigError, DataError
from csm.matching.barycentric import BarycentricMap, centre_faces, nearest_on_faces
from csm.matching.maps import VertexMap
from csm.matching.transfer import transfer
from csm.mesh.shape import Mesh
from csm.mesh.textured import Textured
from tests.shapes import blob, plane, sphere

SOURCE, TARGET = sphere(2), sphere(3)
ALONG = nearest_on_faces(SOURCE.vertices, TARGET.vertices, TARGET.faces, source="coarse", target="fine")
BACK = nearest_on_faces(TARGET.vertices, SOURCE.vertices, SOURCE.faces, source="fine", target="coarse")
N, M = TARGET.n_vertices, TARGET.n_faces
GAP = BarycentricMap(np.where(np.arange(162) == 7, -1, ALONG.faces), ALONG.weights, TARGET.faces, N)


def moved(what, kind=None, along=ALONG, **options):
    return transfer(what, along, SOURCE, TARGET, kind, **options)


@pytest.mark.parametrize(("word", "kind"), [("colours", "colors"), ("color", "colors"), ("Label", "labels")])
def test_a_word_that_is_nearly_a_kind_is_answered_with_it(word, kind):
    with pytest.raises(ConfigError, match=rf"kind='{word}', did you mean '{kind}'\?; wanted values, labels"):
        moved(np.zeros((N, 3), np.uint8), word)


def test_fields_are_those_where_a_vertex_lands():
    np.testing.assert_allclose(moved(TARGET.vertices), SOURCE.vertices, atol=1e-9)
    np.testing.assert_allclose(moved(TARGET.vertices[:, 2].tolist()), SOURCE.vertices[:, 2], atol=1e-9)
    tensor = torch.as_tensor(TARGET.vertices.copy()).float().requires_grad_()
    assert moved(tensor).dtype == np.float32
    matrices = np.einsum("ni,nj->nij", TARGET.vertices, TARGET.vertices)
    assert moved(matrices).shape == (162, 3, 3)
    smooth = transfer(SOURCE.vertices, BACK, TARGET, SOURCE)
    np.testing.assert_allclose(smooth, BACK.points(SOURCE))


def test_labels_are_never_averaged():
    labels = 10 * (TARGET.vertices[:, 0] > 0) + 3 * (TARGET.vertices[:, 1] > 0)
    found = moved(labels)
    assert found.dtype == labels.dtype
    assert set(np.unique(found)) <= set(np.unique(labels))
    np.testing.assert_array_equal(found, 10 * (SOURCE.vertices[:, 0] > 0) + 3 * (SOURCE.vertices[:, 1] > 0))
    halves = nearest_on_faces(plane().vertices[:, :2] * 0.5, plane().vertices[:, :2], plane().faces)
    numbers = np.arange(225) * 1000
    assert set(transfer(numbers, halves, plane(), plane())) <= set(numbers)
    names = np.array(["left", "right"])[(TARGET.vertices[:, 0] > 0).astype(int)]
    assert moved(names)[SOURCE.vertices[:, 0] > 0.1].tolist().count("left") == 0
    assert moved(TARGET.vertices[:, 0], "labels").dtype == np.float64


def test_labels_of_faces_are_those_where_centres_land():
    octant = (TARGET.corners.mean(1) > 0) @ [1, 2, 4]
    centres = SOURCE.corners.mean(1)
    inner = (np.abs(centres) > 0.1).all(1)
    np.testing.assert_array_equal(moved(octant)[inner], ((centres > 0) @ [1, 2, 4])[inner])
    back = transfer(np.arange(SOURCE.n_faces), BACK, TARGET, SOURCE)
    assert len(back) == M
    assert (np.bincount(back, minlength=SOURCE.n_faces) == 4).mean() > 0.9
    itself = BarycentricMap.of_vertices(VertexMap(np.arange(N), N), TARGET.faces)
    np.testing.assert_array_equal(centre_faces(itself, TARGET, TARGET).faces, np.arange(M))


def test_colours_are_averaged_and_rounded():
    colors = np.round(127.5 * (TARGET.vertices + 1)).astype(np.uint8)
    found = moved(colors)
    assert (found.dtype, found.shape) == (np.uint8, (162, 3))
    assert np.abs(found.astype(int) - 127.5 * (SOURCE.vertices + 1)).max() <= 1
    assert moved(np.full((N, 4), 255, dtype=np.uint8)).min() == 255


def test_normals_are_unit_vectors_of_the_target():
    bent = blob(3)
    found = transfer(bent.vertex_normals, ALONG, SOURCE, bent, "normals")
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    vertex = ALONG.weights.max(1) > 0.999
    np.testing.assert_allclose(found[vertex], bent.vertex_normals[ALONG.vertex_map().indices[vertex]], atol=0.02)


def test_landmarks_go_along_the_way_back():
    back = BACK.vertex_map()
    landmarks = ALONG.vertex_map().indices[[3, 50, 161]]
    np.testing.assert_array_equal(moved(landmarks, "landmarks", back=back), [3, 50, 161])
    assert moved([], "landmarks", back=back).shape == (0,)
    with pytest.raises(ConfigError, match="need the map fine -> coarse"):
        moved(landmarks, "landmarks")
    with pytest.raises(DataError, match=r"wanted a list of its vertices, 0\.\.641"):
        moved([642], "landmarks", back=back)
    with pytest.raises(DataError, match="landmarks are float64"):
        moved([0.5], "landmarks", back=back)


@pytest.mark.parametrize(
    ("what", "kind", "filled", "asked"),
    [
        (np.ones(N), None, np.nan, 5.0),
        (np.ones(N, dtype=int), None, -1, 9),
        (np.ones(N, dtype=np.uint16), None, -1, 9),
        (np.ones(N, dtype=bool), None, False, True),
        (np.full(N, "abc"), None, "", "x"),
        (np.full((N, 3), 255, dtype=np.uint8), None, [0, 0, 0], [1, 2, 3]),
        (TARGET.vertex_normals, "normals", [np.nan] * 3, [0, 0, 1]),
    ],
)
def test_what_has_no_partner_is_filled(what, kind, filled, asked):
    np.testing.assert_array_equal(moved(what, kind, GAP)[7], filled)
    np.testing.assert_array_equal(moved(what, kind, GAP, fill=asked)[7], asked)
    others = np.arange(162) != 7
    np.testing.assert_array_equal(moved(what, kind, GAP)[others], moved(what, kind)[others])


def test_faces_at_a_vertex_without_partner_have_none():
    found = moved(np.arange(M), None, GAP)
    np.testing.assert_array_equal(found < 0, (SOURCE.faces == 7).any(1))


def test_what_cannot_be_told_or_does_not_fit_is_named():
    with pytest.raises(ConfigError, match="kind='tint'; wanted values, labels"):
        moved(np.zeros(N), "tint")
    with pytest.raises(ConfigError, match=r"has 642 vertices and 1280 faces, .* float64 of shape \(5,\)"):
        moved(np.zeros(5))
    with pytest.raises(ConfigError, match="wanted a row for each"):
        moved(3.0)
    square = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 1], [1, 2, 0]]))
    itself = BarycentricMap.of_vertices(VertexMap(np.arange(3), 3), square.faces)
    with pytest.raises(ConfigError, match=r"kind=values\|labels"):
        transfer(np.zeros(3), itself, square, square)
    for kind, said in (("labels", "one for each of the 642"), ("faces", "1280 faces"), ("values", "one row for each")):
        with pytest.raises(DataError, match=said):
            moved(np.zeros(5, dtype=int), kind)
    with pytest.raises(DataError, match="colours are float64, wanted uint8"):
        moved(np.zeros((N, 3)), "colors")
    with pytest.raises(DataError, match="normals have shape"):
        moved(np.zeros((N, 2)), "normals")
    with pytest.raises(ConfigError, match="kind=texture wants"):
        moved(np.zeros((N, 2)), "texture")
    with pytest.raises(ConfigError, match="kind=labels wants an array, got a Textured"):
        moved(Textured(TARGET, np.zeros((M, 3, 2))), "labels")
