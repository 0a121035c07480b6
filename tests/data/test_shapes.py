from __future__ import annotations

import pytest

from csm.data.shapes import InMemory, Shape
from csm.errors import DataError
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from tests.shapes import sphere


def a_shape(name: str) -> Shape:
    mesh = sphere(1)
    return Shape(Mesh(mesh.vertices, mesh.faces, name), PointMap.identity(mesh.n_vertices))


def test_a_shape_has_the_name_of_its_mesh():
    assert a_shape("a").name == "a"


def test_shapes_in_memory_are_a_set():
    shapes = InMemory([a_shape("b"), a_shape("a")], "pair")
    assert (shapes.name, shapes.names) == ("pair", ("b", "a"))
    assert shapes.load("a").name == "a"
    assert InMemory({"x": a_shape("a")}).names == ("x",)
    with pytest.raises(DataError, match=r"pair: there is no shape 'c'; there are b, a"):
        shapes.load("c")
    with pytest.raises(DataError, match="2 shapes have only 1 different names"):
        InMemory([a_shape("a"), a_shape("a")])
