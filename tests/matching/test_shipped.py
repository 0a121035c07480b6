"""What the networks that csm brings are worth, on people that they were not trained on."""

from __future__ import annotations

import json

import pytest

from csm.data.humans import HumansSet, humans_set
from csm.data.registry import recognise
from csm.data.shapes import ShapeSet
from csm.data.store import Store
from csm.errors import ConfigError
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol
from csm.matching import as_method
from csm.matching.network import load_model
from csm.matching.shipped import FOLDER, shipped_file, shipped_models

HELD_OUT = ["s08_p01", "s08_p05", "s09_p07"]


EVERY = pytest.mark.parametrize("network", shipped_models())


def error(shapes: ShapeSet, names: list[str], store: Store, network: str = "humans") -> float:
    """Mean error of the nearest descriptor over all pairs, in thousandths of the diameter."""
    protocol = EvaluationProtocol(points=50)
    (found,) = evaluate(network, shapes, protocol, names=names, store=store, workers=0, progress=False)
    return 1000 * float(found.summary["age"])


@EVERY
def test_one_is_found_by_its_name_and_small(network):
    assert repr(as_method(network)) == f"NetworkMethod({network!r}, csmcnn)"
    assert load_model(network, "mine").name == "mine"
    assert load_model(network).key == load_model(shipped_file(network)).key
    assert sum(path.stat().st_size for path in (FOLDER / network).iterdir()) < 3_000_000


def test_they_are_listed_and_others_refused():
    assert shipped_models() == ["humans", "humans_parts"]
    with pytest.raises(ConfigError, match="there is no descriptor 'dogs'"):
        as_method("dogs")


@EVERY
def test_the_card_says_what_it_was_trained_on_and_the_weights_carry_no_path(network):
    card = (FOLDER / network / "README.md").read_text()
    for word in ("Data", "Licence", "Protocol", "Errors", "Limits"):
        assert f"## {word}" in card
    training = json.loads(shipped_file(network).read_text())["training"]
    assert "humans" in training["protocol"]
    assert "=/" not in training["command"]


@pytest.mark.slow
def test_held_out_people_are_matched(tmp_path):
    assert error(HumansSet(), HELD_OUT, Store(tmp_path)) < 8


@pytest.mark.long
def test_held_out_people_are_matched_with_a_part_missing(tmp_path):
    cut = humans_set("cut_30", str(tmp_path))
    assert error(cut, HELD_OUT, Store(tmp_path), "humans_parts") < 30
    assert error(HumansSet(), HELD_OUT, Store(tmp_path), "humans_parts") < 8


@pytest.mark.long
def test_held_out_people_are_matched_with_other_triangles(tmp_path):
    assert error(humans_set("remeshed_5000", str(tmp_path)), HELD_OUT, Store(tmp_path)) < 12


@pytest.mark.data
@pytest.mark.long
@pytest.mark.parametrize(("name", "most"), [("FAUST_6890", 20), ("FAUST_5k_remeshed", 25), ("SHREC19_5k_remeshed", 60)])
def test_scanned_people_are_matched_that_no_one_here_trained_on(data_set, tmp_path, name, most):
    shapes = recognise(data_set(name))
    names = [name for name in shapes.names if name in shapes.names[-12::4]]
    assert error(shapes, names, Store(tmp_path)) < most
