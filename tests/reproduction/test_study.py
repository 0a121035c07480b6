from __future__ import annotations

import csv
import json
from dataclasses import dataclass, field

import pytest

from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.provenance import provenance
from csm.reproduction.study import NO_OPTION, Context, Findings, OnPoints, Study, write_findings
from csm.viewer.comparisons import dots_figure
from tests.reproduction.toys import Toys, measure_no_more, toy_context


def test_findings_are_written_in_three_forms(tmp_path):
    picture = tmp_path / "p.png"
    rows = [{"what": "a, b", "error": 0.012345, "hidden": 7}, {"what": "c", "error": None, "hidden": 8}]
    findings = Findings("table9", "What it is.", ("what", "error"), rows, ("A note.",), (picture,))
    paths = write_findings(findings, tmp_path, provenance(["csm", "reproduce", "table9"]), 1.25)
    assert [path.name for path in paths] == ["table9.json", "table9.csv", "table9.md"]
    record = json.loads(paths[0].read_text())
    assert record["rows"] == rows
    assert record["command"] == "csm reproduce table9"
    assert record["pictures"] == ["p.png"]
    assert {"commit", "versions", "seconds", "notes"} <= set(record)
    assert list(csv.reader(paths[1].open())) == [["what", "error"], ["a, b", "0.0123"], ["c", ""]]
    assert "| a, b | 0.0123 |\n| c |  |" in paths[2].read_text()
    assert paths[2].read_text().endswith("A note.\n")


@dataclass(frozen=True)
class Parade(Study):
    order: str
    sizes: tuple[int, ...] = (1, 2)
    secret: object = field(default=None, metadata=NO_OPTION)
    best: str = "acd"

    def run(self, context: Context) -> Findings:
        figure = dots_figure(["a"], {"error": {"": [1.0]}})
        return self.findings(context, "A parade.", ["what"], [{"what": self.order}], [f"{self.sizes}"], figure)


def test_options_are_the_fields_with_a_default_that_are_not_marked():
    assert Parade.options() == {"sizes": [1, 2], "best": "acd"}


def test_a_study_leaves_a_picture_of_its_name(tmp_path):
    found = Parade("parade", "alphabetical").run(toy_context(tmp_path))
    assert found.pictures == (tmp_path / "out" / "parade.png",)
    assert found.pictures[0].is_file()
    assert (found.name, found.columns, found.notes) == ("parade", ("what",), ("(1, 2)",))


def test_what_the_engine_measured_is_kept_in_the_folder_of_the_artefacts(tmp_path, monkeypatch):
    context = toy_context(tmp_path)
    protocol = EvaluationProtocol([("toy0", "toy1")], points=20, distance="edge")
    (first,) = context.evaluate(["acd_isotropic"], Toys(), protocol)
    assert context.results.files()
    measure_no_more(monkeypatch)
    (again,) = context.evaluate(["acd_isotropic"], Toys(), protocol)
    assert again.errors.tolist() == first.errors.tolist()


def test_points_are_drawn_among_those_of_each_pair(tmp_path):
    class Points(OnPoints):
        def run(self, context):
            raise NotImplementedError

    context, study = toy_context(tmp_path), Points("points", points=30, distance="edge")
    (found,) = study.evaluate(context, ["acd_isotropic"], Toys(), [("toy0", "toy1"), ("toy2", "toy1")])
    assert [(row.source, row.points) for row in found.rows] == [("toy0", 30), ("toy2", 30)]
    assert (found.protocol.drawn, found.protocol.distance) == ("pair", "edge")


def test_a_study_must_say_how_it_runs():
    with pytest.raises(TypeError, match="abstract"):
        Study("nothing")
