from __future__ import annotations

import pytest

import csm
from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching import suited as module
from csm.matching.methods import as_method
from csm.matching.suited import KNOWN, suited
from tests.shapes import blob


@pytest.mark.parametrize(("share", "name"), [(KNOWN, "humans"), (KNOWN - 0.01, "acd")])
def test_the_network_is_taken_where_its_neighbours_return(tmp_path, monkeypatch, share, name):
    monkeypatch.setattr(module, "returning", lambda *_: share)
    monkeypatch.setattr(type(as_method("humans")), "describe", lambda *_: None)
    method, why, described = suited([blob(3), blob(3)], Store(tmp_path))
    assert method.name == name
    assert len(described) == (2 if name == "humans" else 0)
    assert why.startswith(f"model=auto: {100 * share:.0f} % of the nearest neighbours")
    assert ("model=null" if name == "humans" else "model=humans") in why


def test_meshes_that_are_too_small_for_the_network_are_for_the_descriptor(tmp_path, monkeypatch):
    monkeypatch.setattr(type(as_method("humans")), "describe", lambda *_: pytest.fail("it wants 256 vertices"))
    method, why, described = suited([blob(3), blob(2)], Store(tmp_path))
    assert (method.name, described) == ("acd", [])
    assert "fewer than the 256 vertices" in why


def test_a_match_says_what_was_chosen(tmp_path, monkeypatch):
    monkeypatch.setattr("csm.matching.match.suited", lambda *_: (as_method("xyz"), "because", []))
    found = csm.match(blob(2), blob(2), "auto", store=Store(tmp_path))
    assert (found.method.name, found.notes[0]) == ("xyz", "because")
    assert found.matcher.name == "nearest+multistart"


def test_what_is_wrong_is_said_before_the_choice(tmp_path, monkeypatch):
    monkeypatch.setattr("csm.matching.match.suited", lambda *_: pytest.fail("it was chosen first"))
    with pytest.raises(ConfigError, match="refine"):
        csm.match(blob(2), blob(2), "auto", refine="nonsense", store=Store(tmp_path))


@pytest.mark.slow
def test_people_are_known(tmp_path):
    humans = csm.load_humans()
    method, *_ = suited([humans.mesh("s08_p01"), humans.mesh("s09_p02")], Store(tmp_path))
    assert method.name == "humans"


@pytest.mark.data
@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "pair", "chosen"),
    [
        ("TOSCA_5k_remeshed", ("cat1", "cat2"), "acd"),
        ("TOSCA_5k_remeshed", ("horse5", "horse6"), "acd"),
        ("TOSCA_5k_remeshed", ("michael1", "michael2"), "humans"),
        ("SHREC19_5k_remeshed", ("2", "44"), "humans"),
    ],
)
def test_animals_are_not_taken_for_people(data_set, tmp_path, name, pair, chosen):
    shapes = csm.recognise(data_set(name))
    method, *_ = suited([shapes.mesh(each) for each in pair], Store(tmp_path))
    assert method.name == chosen
