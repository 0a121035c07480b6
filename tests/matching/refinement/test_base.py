"""A matcher followed by a refiner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from csm.matching.base import Described
from csm.matching.maps import VertexMap
from csm.matching.nearest import Nearest
from csm.matching.refinement import Refined, RefinedMap, Refiner
from csm.matching.way import Way
from tests.matching.pairs import as_map, described
from tests.shapes import blob


@dataclass(frozen=True)
class Backwards(Refiner):
    """Reverse the numbers of the target and add a step."""

    step: int = 1

    name: ClassVar[str] = "backwards"

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        n = target.mesh.n_vertices
        return RefinedMap(Way(as_map((n - 1 - start.indices + self.step) % n, source, target)))


def test_the_refiner_is_given_the_map_of_the_matcher_and_both_shapes(store):
    mesh = blob(1)
    source, target = described(mesh, store, mesh.vertices), described(mesh, store, mesh.vertices)
    both = Refined(Nearest(), Backwards(2))
    found = both(source, target, at=np.array([3]))
    np.testing.assert_array_equal(found.indices, (43 - np.arange(42)) % 42)
    assert (found.source, found.target) == ("blob", "blob")


def test_name_and_parameters_are_those_of_both():
    both = Refined(Nearest(), Backwards(5))
    assert both.name == "nearest+backwards"
    assert both.parameters() == {**Nearest().parameters(), "refiner": {"name": "backwards", "step": 5}}
    assert both.parameters() != Refined(Nearest(), Backwards(6)).parameters()
