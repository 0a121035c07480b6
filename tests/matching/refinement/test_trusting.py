from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.confidence import returning_both_ways
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import RefinedMap
from csm.matching.refinement.joint import Joint
from csm.matching.refinement.multistart import Multistart
from csm.matching.refinement.trusting import Trusting
from csm.matching.way import Way
from csm.mesh.perturb import without_part
from tests.shapes import blob


@pytest.fixture
def pair():
    """A mesh twice, described by its positions."""
    mesh = blob(2)
    features = torch.tensor(mesh.vertices)
    return Described(mesh, features), Described(mesh, features)


def noisy(described: Described, share: float) -> Described:
    """Return the shape with the descriptors of a share of its vertices exchanged."""
    rng = np.random.default_rng(0)
    at = rng.choice(described.mesh.n_vertices, int(share * described.mesh.n_vertices), replace=False)
    features = described.features.clone()
    features[at] = described.features[rng.permutation(at)] + 0.3
    return Described(described.mesh, features)


def test_the_shares_are_those_of_both_ways(pair):
    assert returning_both_ways(*pair) == (1, 1)
    here, there = pair[0], noisy(pair[1], 0.3)
    shares = returning_both_ways(here, there)
    assert shares == returning_both_ways(there, here)[::-1]
    assert min(shares) < 0.97


@pytest.mark.parametrize(("share", "chosen", "said"), [(0.0, "joint", "kept"), (0.3, "search", "searched for")])
def test_only_a_start_that_returns_is_trusted(pair, monkeypatch, share, chosen, said):
    start = VertexMap(np.arange(162), 162)
    done = {name: RefinedMap(Way(start), text=name) for name in ("joint", "search")}
    monkeypatch.setattr(Joint, "__call__", lambda *_: done["joint"])
    monkeypatch.setattr(Multistart, "__call__", lambda *_: done["search"])
    found = Trusting()(start, pair[0], noisy(pair[1], share))
    assert found.forward is done[chosen].forward
    assert f"the start was {said}: {chosen}" in found.text


@pytest.mark.parametrize(("n_astray", "said"), [(10, "kept"), (0, "refined throughout")])
def test_a_refined_map_that_returns_better_than_the_start_is_taken_whole(pair, monkeypatch, n_astray, said):
    indices = np.arange(162)
    indices[:n_astray] = 161 - indices[:n_astray]
    way, back = Way(VertexMap(indices, 162)), Way(VertexMap(np.arange(162), 162))
    monkeypatch.setattr(Joint, "__call__", lambda *_: RefinedMap(way, back, "joint"))
    there = noisy(pair[1], 0.03)
    found = Trusting(returning=0.9)(way.vertex_map, pair[0], there)
    assert f"the start was {said}: joint" in found.text
    assert (found.forward is way) == (said == "refined throughout")


@pytest.mark.parametrize("turned", [False, True])
def test_a_part_that_returns_keeps_its_neighbours_and_is_not_searched_for(monkeypatch, turned):
    """What the whole has more cannot return, which says nothing against the start."""
    whole = blob(3)
    cut = without_part(whole, 0, 0.3)
    shapes = [Described(mesh, torch.tensor(mesh.vertices)) for mesh in (cut.mesh, whole)]
    source, target = shapes[::-1] if turned else shapes
    monkeypatch.setattr(
        Multistart, "__call__", lambda *_: RefinedMap(Way(VertexMap(np.zeros(1, int), 1)), text="search")
    )
    found = Trusting()(VertexMap(np.zeros(source.mesh.n_vertices, int), target.mesh.n_vertices), source, target)
    to_whole = found.backward if turned else found.forward
    np.testing.assert_array_equal(to_whole.vertex_map.indices, cut.kept)
    assert "100 % of the nearest neighbours of" in found.text
    assert "kept as they are" in found.text
    odd = Described(cut.mesh, noisy(shapes[0], 0.5).features)
    assert "searched for" in Trusting()(VertexMap(np.zeros(len(cut.kept), int), whole.n_vertices), odd, shapes[1]).text


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_is_between_0_and_1(share):
    for option in ("returning", "of_part"):
        with pytest.raises(ConfigError, match="wanted shares from 0 to 1"):
            Trusting(**{option: share})
