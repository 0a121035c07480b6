from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from csm.operators import Operators
from csm.operators.stencils import STENCILS, Stencil
from tests.shapes import blob


@dataclass(frozen=True)
class Valence(Stencil):
    """How many faces meet in a vertex, plus a number."""

    more: int = 0

    name: ClassVar[str] = "valence"

    def __call__(self, operators):
        return {"count": np.bincount(operators.mesh.faces.ravel()) + self.more}


@dataclass(frozen=True)
class Mended(Valence):
    version: ClassVar[int] = 2


def test_a_stencil_states_its_fields_and_gets_the_rest():
    assert Valence(more=3).parameters() == {"more": 3}, "without the first version"
    assert Mended(more=3).parameters() == {"more": 3, "version": 2}
    mesh = blob(2)
    assert Valence(more=1)(Operators(mesh))["count"].sum() == 3 * mesh.n_faces + mesh.n_vertices


def test_a_stencil_that_cannot_be_called_is_none():
    class Nothing(Stencil):
        name = "nothing"

    with pytest.raises(TypeError, match="__call__"):
        Nothing()


def test_all_stencils_derive_from_the_base_and_are_in_their_first_version():
    assert all(issubclass(each, Stencil) for each in STENCILS.values())
    assert {each.version for each in STENCILS.values()} == {1}, "a higher one makes stores compute it anew"
