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


def error(shapes: ShapeSet, names: list[str], store: Store) -> float:
    """Mean error of the nearest descriptor over all pairs, in thousandths of the diameter."""
    protocol = EvaluationProtocol(points=50)
    (found,) = evaluate("humans", shapes, protocol, names=names, store=store, workers=0, progress=False)
    return 1000 * float(found.summary["age"])


def test_they_are_found_by_name_and_small():
    assert shipped_models() == ["humans"]
    assert repr(as_method("humans")) == "NetworkMethod('humans', csmcnn)"
    assert load_model("humans", "mine").name == "mine"
    assert load_model("humans").key == load_model(shipped_file("humans")).key
    assert sum(path.stat().st_size for path in (FOLDER / "humans").iterdir()) < 3_000_000
    with pytest.raises(ConfigError, match="there is no descriptor 'dogs'"):
        as_method("dogs")


def test_the_card_says_what_it_was_trained_on_and_the_weights_carry_no_path():
    card = (FOLDER / "humans" / "README.md").read_text()
    for word in ("Data", "Licence", "Protocol", "Errors", "Limits"):
        assert f"## {word}" in card
    training = json.loads(shipped_file("humans").read_text())["training"]
    assert "humans" in training["protocol"]
    assert "=/" not in training["command"]


@pytest.mark.slow
def test_held_out_people_are_matched(tmp_path):
    assert error(HumansSet(), HELD_OUT, Store(tmp_path)) < 8


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
