from __future__ import annotations

import numpy as np
import pytest

import csm
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from tests.matching.collection.copies import QUICK, copies, share_right


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    first, *others = copies(3)
    debris = np.array([[9.0, 9, 9]])  # a vertex in no face: results are on the vertices as they were given
    given = [Mesh(np.concatenate([debris, first.vertices]), first.faces + 1, "s0"), *others]
    return csm.match_collection(
        given, "wks", refiner=QUICK, store=tmp_path_factory.mktemp("store"), workers=0, progress=False
    )


def test_maps_are_on_the_vertices_as_they_were_given(found):
    there, back = found.vertex_map("s0", "s2"), found.vertex_map(2, 0)
    assert len(there) == len(back) + 1
    assert there.indices[0] == -1
    assert share_right(there.indices[1:], 0, 2, 3) > 0.95
    assert back.n_target == len(there)
    assert share_right(back.indices - 1, 2, 0, 3) > 0.95


def test_a_match_of_two_shapes_is_their_vertex_map_with_all_else(found):
    match = found.match("s1", "s2")
    assert np.array_equal(match.indices, found.vertex_map("s1", "s2").indices)
    assert match.source is found.meshes[1]
    assert match.barycentric is not None
    assert match.confidence.returned > 0.95
    assert "close every cycle" in match.refinement


def test_a_match_is_the_same_map_from_either_side(found):
    match = found.match("s2", "s1")
    assert (match.source.name, match.target.name) == ("s2", "s1")
    for i, j in (("s2", "s1"), ("s1", "s2")):
        assert np.array_equal(found.match(i, j).indices, found.vertex_map(i, j).indices)


def test_the_trusted_share_is_that_of_the_match_and_takes_maps_that_are_there(found, monkeypatch):
    names = [name for name in found.names if name != found.reference]
    one_by_one = {name: found.match(name, found.reference).confidence.trusted for name in names}
    found.vertex_maps([(name, found.reference) for name in names], workers=0, progress=False)

    def again(*_):
        raise AssertionError("a map is computed a second time")

    monkeypatch.setattr("csm.matching.collection.result.both_maps", again)
    monkeypatch.setattr("csm.matching.collection.result.finest", again)
    assert found.trusted == one_by_one
    assert min(one_by_one.values()) > 0.9


def test_functional_maps_close_every_cycle_and_are_orthogonal(found):
    ab, bc, ca = (found.functional_map(*pair).matrix for pair in ((0, 1), (1, 2), (2, 0)))
    assert np.allclose(ab @ bc @ ca, np.eye(len(ab)), atol=1e-8)


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_many_maps_are_those_made_one_by_one(found, workers):
    every = found.vertex_maps(workers=workers, progress=False)
    assert [(m.source, m.target) for m in every][:3] == [("s0", "s1"), ("s0", "s2"), ("s1", "s0")]
    assert len(every) == 6
    (one,) = found.vertex_maps([("s2", "s1")], workers=0, progress=False)
    assert np.array_equal(one.indices, every[5].indices)
    assert share_right(one.indices, 2, 1, 3) > 0.95


def test_shapes_are_called_by_name_or_number(found):
    assert found.number("s2") == found.number(-1) == found.number(2) == 2
    assert found.reference in found.names
    assert repr(found).startswith("MatchedCollection(3 shapes by wks, reference s")
    for which in ("s9", 3, -4):
        with pytest.raises(ConfigError, match="among the 3: s0, s1, s2"):
            found.number(which)
