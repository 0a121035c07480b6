from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from csm.data.registry import find_set
from csm.data.store import Store
from csm.errors import ConfigError, DataError
from csm.evaluation.provenance import provenance
from csm.mesh.io import write_mesh
from csm.reproduction.published import AGE
from csm.reproduction.study import Context, Findings, write_findings
from csm.reproduction.table1 import WITHIN, Figure4, Table1, ranks, usable_pairs
from tests.remeshedset import write_faust, write_shrec19, write_tosca
from tests.reproduction.toys import measure_no_more

SMALL = ("acd_paper", "amks", "smwd")


def run(context: Context, **options: object) -> Findings:
    return Table1("table1", **options).run(context)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def context(tmp_path_factory) -> Context:
    folder = tmp_path_factory.mktemp("table1")
    write_faust(folder / "data" / "one" / "FAUST")
    write_shrec19(folder / "data" / "SHREC19")
    write_tosca(folder / "data" / "TOSCA")
    return Context(folder / "data", folder / "out", Store(folder / "store"))


@pytest.fixture(scope="module")
def findings(context):
    return run(context, descriptors=SMALL, exact_points=40)


def test_every_descriptor_has_a_row_with_the_paper_and_ours_for_every_set(findings):
    assert [row["descriptor"] for row in findings.rows] == list(SMALL)
    for row in findings.rows:
        for key, title in (("faust", "FAUST"), ("shrec19", "SHREC'19"), ("tosca", "TOSCA")):
            assert row[f"{title} paper"] == AGE[row["family"]][key]
            assert row[f"{title} ours"] == f"{1000 * row[key]['age']:.1f} ± {1000 * row[key]['std']:.1f}"
            assert row[f"{title} ranks"] == f"{row[key]['paper_rank']} / {row[key]['rank']}"
            assert 0 < row[key]["age"] < 0.6
    assert [row["faust"]["paper_rank"] for row in findings.rows] == [1, 2, 3]
    assert findings.rows[2]["assumed"] == "all parameters"
    assert "| SHREC'19 paper | SHREC'19 ours |" in findings.markdown()
    assert findings.pictures[0].is_file()


def test_the_pairs_are_those_with_ground_truth_and_of_faust_of_one_person(context, findings):
    assert [findings.rows[0][key]["pairs"] for key in ("faust", "shrec19", "tosca")] == [3, 2, 2]
    notes = " ".join(findings.notes)
    assert "3 pairs of two poses of one person among the 4" in notes
    assert "the 2 of 3 pairs whose ground truth is there (2 of 3 shapes have maps)" in notes
    assert usable_pairs("faust", find_set(context.root, "FAUST_5k_remeshed"))[-1] == ("tr_reg_010", "tr_reg_011")


def test_the_json_is_strict_and_what_is_not_known_is_null(findings, context, tmp_path):
    path = write_findings(findings, tmp_path, provenance(), 1.0)[0]
    row = json.loads(path.read_text(), parse_constant=lambda text: pytest.fail(text))["rows"][0]
    assert row["shrec19"]["flip_rate"] is None
    assert math.isfinite(row["faust"]["flip_rate"])


def test_a_second_run_measures_nothing(context, findings, monkeypatch):
    measure_no_more(monkeypatch)
    assert run(context, descriptors=SMALL, exact_points=40).markdown() == findings.markdown()


def test_exact_points_change_the_numbers_little_and_are_the_only_ones_if_all_are(context, findings):
    whole = run(context, sets=("faust",), descriptors=SMALL[:1], exact_points=None)
    (row,) = whole.rows
    assert row["faust"]["uncertainty"] == 0
    assert row["faust"]["age"] == pytest.approx(findings.rows[0]["faust"]["age"], rel=0.05)
    assert "All distances are exact." in whole.notes


def test_pairs_and_points_may_be_drawn(context):
    (row,) = run(context, sets=("faust",), descriptors=SMALL[:1], exact_points=10, sample=1, points=20).rows
    assert (row["faust"]["pairs"], row["faust"]["points"]) == (1, 20)


def test_a_set_that_is_not_there_is_left_out_and_said_so(tmp_path):
    write_tosca(tmp_path / "data")
    context = Context(tmp_path / "data", tmp_path / "out", Store(tmp_path / "store"))
    findings = run(context, descriptors=SMALL[:1], exact_points=10)
    assert "left out: FAUST, SHREC'19." in findings.notes[-1]
    with pytest.raises(DataError, match="none of the sets faust is there"):
        run(context, sets=("faust",), descriptors=SMALL[:1])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sets": ("scape",)}, "faust, shrec19, tosca"),
        ({"sets": ()}, "wanted some descriptors, and sets out of"),
        ({"descriptors": ("nothing",)}, "there is no descriptor"),
        ({"descriptors": ()}, "wanted some descriptors"),
        ({"exact_points": 0}, "from 1"),
        ({"sample": 0}, "from 1"),
    ],
)
def test_wrong_options_are_refused(context, options, message):
    with pytest.raises(ConfigError, match=message):
        run(context, **options)


def test_a_preset_is_ranked_among_other_families_only():
    assert ranks({"acd_paper": 0.5, "acd_release": 0.4, "wks": 0.45, "gps": 0.1}) == {
        "acd_paper": 2,
        "acd_release": 1,
        "wks": 2,
        "gps": 1,
    }


def test_figure_4_has_the_curves_of_the_same_evaluations_in_one_picture(context, findings, monkeypatch):
    measure_no_more(monkeypatch)
    found = Figure4("figure4", descriptors=SMALL, exact_points=40).run(context)
    titles = {"FAUST": "faust", "SHREC'19": "shrec19", "TOSCA": "tosca"}
    assert [(row["set"], row["descriptor"]) for row in found.rows] == [(t, name) for t in titles for name in SMALL]
    for row in found.rows:
        (line,) = (r for r in findings.rows if r["descriptor"] == row["descriptor"])
        assert row["area under the curve"] == line[titles[row["set"]]]["auc"]
        curve = dict(zip(np.round(row["thresholds"], 6), row["cqc"], strict=True))
        for limit in WITHIN:
            assert row[f"% within {limit:g}"] == pytest.approx(100 * curve[limit])
    (path,) = found.pictures
    assert Image.open(path).width > Image.open(path).height


def test_shapes_that_cannot_be_used_are_left_out_with_their_pairs_and_said_so(tmp_path):
    shapes = find_set(write_faust(tmp_path / "data" / "FAUST"), "FAUST_5k_remeshed")
    path = shapes.entry("tr_reg_010").mesh
    path.write_text(path.read_text().replace("162 320 0", "163 320 0"))
    mesh = shapes.mesh("tr_reg_001")
    fin = [*mesh.faces[0, :2], mesh.faces[100, 0]]
    write_mesh(shapes.entry("tr_reg_001").mesh, replace(mesh, faces=np.vstack([mesh.faces, [fin]])))
    context = Context(tmp_path / "data", tmp_path / "out", Store(tmp_path / "store"))
    found = run(context, sets=("faust",), descriptors=SMALL[:2], exact_points=10)
    assert [row["faust"]["pairs"] for row in found.rows] == [1, 1]
    (note,) = (note for note in found.notes if note.startswith("FAUST:"))
    assert "1 pairs measured" in note
    assert " tr_reg_010 is left out: " in note
    assert " tr_reg_001 is left out: " in note


def test_a_descriptor_that_fails_on_every_pair_is_named(context, monkeypatch):
    failed = SimpleNamespace(method="smwd", rows=(), failures={"tr_reg_001": "not finite"})
    monkeypatch.setattr(Context, "evaluate", lambda *_, **__: [failed])
    with pytest.raises(DataError, match=r"FAUST: none of the pairs could be measured by smwd: .*not finite"):
        run(context, sets=("faust",), descriptors=SMALL)


@pytest.mark.data
def test_two_shapes_of_faust_by_quick_descriptors(data_set, tmp_path):
    root = data_set("FAUST_5k_remeshed")
    context = Context(root, tmp_path / "out", Store(tmp_path / "store"))
    options = {"sets": ("faust",), "descriptors": ("acd_paper", "smwd"), "sample": 1, "exact_points": 8}
    acd, smwd = (row["faust"] for row in run(context, **options).rows)
    assert acd["points"] == 5000
    assert 0.01 < acd["age"] < smwd["age"] < 0.4
