from __future__ import annotations

import numpy as np
import pytest

import csm
from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching import suited as module
from csm.matching.methods import as_method
from csm.matching.suited import KNOWN, suited
from csm.mesh.perturb import without_part
from tests.shapes import blob


@pytest.mark.parametrize(("share", "name"), [(KNOWN, "humans"), (KNOWN - 0.01, "acd")])
def test_the_network_is_taken_where_its_neighbours_return(tmp_path, monkeypatch, share, name):
    monkeypatch.setattr(module, "returning_both_ways", lambda *_: (1.0, share))
    monkeypatch.setattr(type(as_method("humans")), "describe", lambda *_: None)
    method, why, described = suited([blob(3), blob(3)], Store(tmp_path))
    assert method.name == name
    assert len(described) == (2 if name == "humans" else 0)
    assert why.startswith(f"model=auto: {100 * share:.0f} % of the nearest neighbours")
    assert ("model=null" if name == "humans" else "model=humans insists, model=humans_parts where a part is") in why


@pytest.mark.parametrize(("share", "name"), [(KNOWN, "humans_parts"), (KNOWN - 0.01, "acd")])
def test_of_a_part_and_its_whole_the_part_decides(tmp_path, monkeypatch, share, name):
    whole = blob(3)
    monkeypatch.setattr(module, "returning_both_ways", lambda *_: (0.3, share))
    monkeypatch.setattr(type(as_method("humans")), "describe", lambda *_: None)
    method, why, _ = suited([whole, without_part(whole, 0, 0.3).mesh], Store(tmp_path))
    assert method.name == name
    assert f"{100 * share:.0f} % of the nearest neighbours of {whole.name} in the network humans_parts" in why


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


@pytest.mark.long
def test_parts_of_people_are_known_and_are_matched(tmp_path):
    humans = csm.load_humans()
    whole, cut = humans.mesh("s09_p07"), without_part(humans.mesh("s08_p01"), 100, 0.3)
    found = csm.match(cut.mesh, whole, "auto", store=Store(tmp_path))
    assert found.method.name == "humans_parts"
    assert np.linalg.norm(whole.vertices[found.indices] - whole.vertices[cut.kept], axis=1).mean() < 0.05


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
