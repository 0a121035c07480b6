from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np
import pytest

from csm.evaluation import EvaluationProtocol
from csm.evaluation.report import read_rows
from csm.experiments.report import vertex_errors, write_results
from csm.experiments.testing import measure_set
from csm.learning.loading import LightningData
from csm.matching.nearest import nearest
from csm.matching.network import NetworkMethod
from csm.operators.geodesic import geodesics
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


def test_results_are_merged_only_where_they_are_asked_for(tested, tmp_path):
    write_results(tested[:1], tmp_path / "out", None, "")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_the_errors_of_a_picture_are_heat_distances_at_every_vertex(tested):
    pair = tested[0].names
    source, target = (tested[0].shapes.load(name).mesh for name in pair)
    errors = vertex_errors(tested[0], pair, source.n_vertices)
    here, there = (tested[0].method.describe(mesh, tested[0].store).features for mesh in (source, target))
    rows = geodesics(target, "heat").rows(np.arange(162))
    expected = rows[np.arange(162), nearest(here, there)] / np.sqrt(target.area)
    np.testing.assert_allclose(errors, expected, atol=1e-9)
