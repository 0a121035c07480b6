from __future__ import annotations

import csv
import json

from csm.evaluation.provenance import provenance
from csm.studies import Findings, write_findings


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
