import numpy as np

from csm.data.cleaned import CleanedSet, cleaned_shape
from csm.data.shapes import InMemory, Shape, templates_of
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.shape import Mesh
from tests.mesh.test_debris import scattered
from tests.shapes import blob


def test_maps_go_to_the_vertices_of_the_cleaned_mesh():
    mesh, number = scattered(blob(2), 6, 1e-3)
    truth = PointMap(np.append(number, mesh.n_vertices - 1), Direction.TEMPLATE_TO_SHAPE, mesh.n_vertices)
    shape = cleaned_shape(Shape(mesh, truth, truth))
    np.testing.assert_allclose(shape.mesh.vertices[shape.truth.indices[:162]], blob(2).vertices)
    assert shape.truth.n_to == 162
    assert (shape.mirror.indices == shape.truth.indices).all()
    assert "debris" in shape.truth.notes[-1]


def test_points_on_what_was_left_out_have_no_counterpart():
    ball = blob(2)
    mesh = Mesh(np.vstack([ball.vertices, [[9, 9, 9]]]), ball.faces, "lone")
    truth = PointMap(np.array([162, 0, -1]), Direction.TEMPLATE_TO_SHAPE, 163)
    assert cleaned_shape(Shape(mesh, truth)).truth.indices.tolist() == [-1, 0, -1]


def test_a_set_is_cleaned_shape_by_shape_and_a_good_shape_is_the_same():
    good = Shape(blob(2), PointMap.identity(162, 162))
    inner = InMemory([good], "toys")
    shapes = CleanedSet(inner)
    assert shapes.load("blob") is good
    assert (shapes.name, shapes.names) == ("toys", ("blob",))
    assert templates_of(shapes) == templates_of(inner)
