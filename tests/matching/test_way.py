from __future__ import annotations

import numpy as np

from csm.matching.barycentric import BarycentricMap
from csm.matching.maps import VertexMap
from csm.matching.way import Way
from tests.shapes import sphere


def test_a_way_says_what_is_known_of_it():
    plain = VertexMap(np.arange(3), 42, "a", "b")
    assert repr(Way(plain)) == "Way(a -> b, vertex_map)"
    both = Way(plain, precise=lambda: BarycentricMap.of_vertices(plain, sphere(1).faces))
    assert repr(both) == "Way(a -> b, vertex_map, precise)"
    assert both.barycentric is both.barycentric  # computed once
    assert both.functional_map is None
