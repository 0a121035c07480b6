from __future__ import annotations

import csv
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from csm.evaluation import EvaluationProtocol
from csm.evaluation.report import read_rows
from csm.experiments.report import training_section, write_results
from csm.experiments.testing import measure_set
from csm.experiments.training import Trained
from csm.learning.loading import LightningData
from csm.matching.network import NetworkMethod
from tests.learning.toys import make
from tests.toyset import toy_datamodule

if TYPE_CHECKING:
    from csm.experiments.testing import Tested

PROTOCOL = EvaluationProtocol(points=40, distance="edge", normaliser="sqrt_area")


@pytest.fixture(scope="module")
def tested(tmp_path_factory) -> list[Tested]:
    data = toy_datamodule(tmp_path_factory.mktemp("report"))
    module = make(LightningData(data), training={"name": "net", "set": "toys", "seed": 4, "epochs": 7})
    return measure_set(NetworkMethod(module), data, data.train_set, PROTOCOL, matching=["nearest", "argmax"])


def test_a_test_leaves_rows_curves_pictures_and_a_page(tested, tmp_path):
    page = write_results(tested, tmp_path / "out", tmp_path / "results.json", "Trained on little.")
    rows = [t.row for t in tested]
    assert read_rows(tmp_path / "out/rows.json") == read_rows(tmp_path / "results.json") == rows
    with (tmp_path / "out/rows.csv").open() as file:
        assert [line["matching"] for line in csv.DictReader(file)] == ["nearest", "argmax"]
    assert (tmp_path / "out/cqc.csv").read_text().startswith('threshold,toys,"toys, argmax"')
    assert {"report.html", "cqc.png", "map_toys.png", "map_toys_argmax.png"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }
    text = page.read_text()
    assert "net, trained on toys" in text
    assert "Trained on little." in text
    assert tested[0].row.command.replace("'", "&#x27;").split()[0] in text
    assert "the pair with the median error" in text
    assert text.index("<h2>Worst pairs first") < text.index("the worst pair (") < text.index("<h2>A typical pair")
    assert text.count('class="viewer"') == 2 * 2 + 1, "two worst pairs of each of two matchers, and a typical one"


def test_a_page_tells_how_the_training_went(tested, tmp_path):
    module = tested[0].method.module
    trained = Trained(module, tmp_path / "model.ckpt", 90.0, {}, curves={"train/loss": [(1, 5.0), (2, 3.0)]})
    page = write_results(tested[:1], tmp_path, None, "", [training_section(trained)]).read_text()
    count = sum(weights.numel() for weights in module.network.parameters())
    assert trained.parameters == count > 1000
    assert f"{count:,} parameters; 7 epochs in 1.5 minutes." in page
    without = training_section(replace(trained, curves={}))
    assert len(training_section(trained).blocks) == len(without.blocks) + 1


def test_results_are_merged_only_where_they_are_asked_for(tested, tmp_path):
    write_results(tested[:1], tmp_path / "out", None, "")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
