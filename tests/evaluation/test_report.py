"""Result rows survive the disk, refuse what cannot be true, and merge by cell."""

from __future__ import annotations

import csv
import json
import multiprocessing
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from csm.errors import DataError
from csm.evaluation import report
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.provenance import Provenance
from csm.evaluation.report import ResultRow, add_rows, merge_rows, read_rows, result_row, write_rows
from tests.conftest import ROOT
from tests.evaluation.toys import Fixed, Noisy, measure, shapes

MADE = Provenance("csm train", "abc123", {"torch": "2.13.0"})


def row(**changes: object) -> ResultRow:
    base = ResultRow(
        table="4",
        method="CSMCNN",
        train="FAUST",
        test="FAUST 6890",
        age=0.0097,
        age_std=0.0003,
        exact_match=0.61,
        seeds=(0, 1, 2),
        epochs=50,
        pairs=380,
        distance="exact",
        normaliser="diameter",
        command="csm train",
        commit="abc",
        versions={"numpy": "2"},
        seconds=61.5,
    )
    return replace(base, **changes)  # type: ignore[arg-type]


def test_rows_come_back_from_disk_as_they_were(tmp_path: Path) -> None:
    rows = [row(), row(test="FAUST 10000", age_std=None, epochs=None, seeds=(), p95=0.02, flip_rate=0.0)]
    write_rows(tmp_path / "new" / "r.json", rows)
    assert read_rows(tmp_path / "new" / "r.json") == rows
    entry = json.loads((tmp_path / "new" / "r.json").read_text())[0]
    wanted = "table method train test age age_std exact_match seeds epochs pairs distance normaliser command commit"
    assert {*wanted.split(), "versions", "seconds"} <= set(entry)


def test_rows_that_are_older_than_a_field_are_read(tmp_path: Path) -> None:
    write_rows(tmp_path / "r.json", [row(split="mine (4 train, 2 test, 0)", weights="abc")])
    (entry,) = json.loads((tmp_path / "r.json").read_text())
    assert (entry.pop("split"), entry.pop("weights")) == ("mine (4 train, 2 test, 0)", "abc")
    (tmp_path / "r.json").write_text(json.dumps([entry]))
    assert read_rows(tmp_path / "r.json") == [row()]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.json"
    write_rows(path, [row()])
    monkeypatch.setattr(report.json, "dumps", lambda *a, **k: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_rows(path, [row(age=0.5)])
    assert read_rows(path) == [row()]
    assert [p.name for p in tmp_path.iterdir()] == ["r.json"]


def test_a_new_row_replaces_its_cell_and_keeps_the_order(tmp_path: Path) -> None:
    a, b, c = row(), row(test="FAUST 15000"), row(test="SCAPE")
    better = row(age=0.009, commit="def")
    assert merge_rows([a, b], [better, c]) == [better, b, c]
    assert merge_rows([a], [row(distance="edge")])[0] == a
    assert merge_rows([a], [row(matching="argmax")]) == [a, row(matching="argmax")]
    path = tmp_path / "r.json"
    add_rows(path, [a, b])
    assert add_rows(path, [better, c]) == read_rows(path) == [better, b, c]


def test_rows_of_other_seeds_stay_and_their_mean_takes_their_place() -> None:
    zero, one, both = (row(seeds=seeds) for seeds in ((0,), (1,), (0, 1)))
    assert merge_rows([zero], [one]) == [zero, one]
    assert merge_rows([zero, one], [row(seeds=(1,), age=0.5)]) == [zero, row(seeds=(1,), age=0.5)]
    assert merge_rows([zero, one], [both]) == [both]
    assert merge_rows([both], [one]) == [both, one]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("age", -1.0),
        ("age", float("nan")),
        ("exact_match", 1.2),
        ("auc", 7.0),
        ("pairs", 0),
        ("commit", ""),
        ("matching", ""),
        ("age", None),
    ],
)
def test_values_that_cannot_be_true(field: str, value: object) -> None:
    with pytest.raises(DataError, match=field):
        row(**{field: value})


def test_rows_of_the_first_format_have_the_matcher_in_the_name_of_the_method(tmp_path: Path) -> None:
    entries = []
    for name in ("CSMCNN, argmax", "CSMCNN", "ACD, K = 20"):
        entries.append({key: value for key, value in asdict(row(method=name)).items() if key != "matching"})
    entries.append(asdict(row(method="mine, argmax", matching="nearest")))
    (tmp_path / "r.json").write_text(json.dumps(entries))
    found = [(r.method, r.matching) for r in read_rows(tmp_path / "r.json")]
    assert found == [
        ("CSMCNN", "argmax"),
        ("CSMCNN", "nearest"),
        ("ACD, K = 20", "nearest"),
        ("mine, argmax", "nearest"),
    ]


def test_rows_inside_the_published_tables_are_read(tmp_path: Path) -> None:
    lines = json.loads((ROOT / "results/table4.json").read_text())["rows"]
    inside = [entry for line in lines for entry in line["rows"]]
    (tmp_path / "r.json").write_text(json.dumps(inside))
    found = read_rows(tmp_path / "r.json")
    assert len(found) == len(inside) > 20
    assert {r.matching for r in found} == {"nearest", "argmax"}
    assert not any("," in r.method for r in found)
    assert len({r.key for r in found}) == len(found)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{}", "wanted a list"),
        ("[3]", "row 0 is a int"),
        ('[{"table": "4"}]', "lacks.*'age'"),
        ("[", "not a json"),
        ("", "not a json"),
        ("[" * 100_000, "not a json"),
        (json.dumps([{**asdict(row()), "seeds": 3}]), "row 0: "),
        (json.dumps([{**asdict(row()), "age": "small"}]), "row 0: "),
        (json.dumps([{**asdict(row()), "pairs": None}]), "row 0: "),
        (json.dumps([{**asdict(row()), "exact_match": 1.5}]), "row 0: .*exact_match is 1.5"),
    ],
)
def test_foreign_files_are_refused_by_name_and_never_replaced(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "r.json"
    path.write_text(text)
    with pytest.raises(DataError, match=f"r.json.*{said}"):
        read_rows(path)
    with pytest.raises(DataError, match=f"r.json.*{said}"):
        add_rows(path, [row()])
    assert path.read_text() == text


def _add(path: str, name: str, n: int) -> None:
    for i in range(n):
        add_rows(path, [row(method=f"{name} {i}")])


@pytest.mark.parametrize("n", [25, pytest.param(100, marks=pytest.mark.long)])
def test_processes_that_add_rows_at_once_lose_none(tmp_path: Path, n: int) -> None:
    path = str(tmp_path / "r.json")
    context = multiprocessing.get_context("fork")
    adding = [context.Process(target=_add, args=(path, name, n)) for name in "abcd"]
    for process in adding:
        process.start()
    for process in adding:
        process.join(120)
    assert [process.exitcode for process in adding] == [0] * 4
    assert {r.method for r in read_rows(path)} == {f"{name} {i}" for name in "abcd" for i in range(n)}
    assert [p.name for p in tmp_path.iterdir() if not p.name.startswith(".")] == ["r.json"]


def test_a_row_averages_over_seeds() -> None:
    items = shapes()
    runs = [measure(items, rule) for rule in (Noisy(), Fixed(tuple(range(162))))]
    made = result_row(runs, MADE, table="4", method="m", train="a", test="b", seeds=[0, 1], epochs=5)
    ages = [run.summary["age"] for run in runs]
    assert made.age == pytest.approx(np.mean(ages))
    assert made.age_std == pytest.approx(np.std(ages, ddof=1))
    assert made.protocol == EvaluationProtocol().describe(6)
    assert made.matching == "noisy"
    single = result_row(runs[:1], MADE, table="4", method="m", train="a", test="b", seeds=[0], epochs=5)
    assert single.age_std is None
    other = measure(items, Noisy(), EvaluationProtocol(distance="edge"))
    with pytest.raises(DataError, match="one protocol"):
        result_row([runs[0], other], MADE, table="4", method="m", train="a", test="b", seeds=[0], epochs=5)


def test_csv_of_rows_and_of_curves(tmp_path: Path) -> None:
    report.write_table_csv(tmp_path / "t.csv", [row()])
    with (tmp_path / "t.csv").open() as file:
        line = next(csv.DictReader(file))
    assert (line["method"], line["age"], line["seeds"]) == ("CSMCNN", "0.0097", "0 1 2")
    run = measure(shapes(2), Noisy())
    report.write_curves_csv(tmp_path / "c.csv", {"ours": run})
    values = np.loadtxt(tmp_path / "c.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(values, np.column_stack([run.thresholds, run.cqc]), atol=1e-6)
    with pytest.raises(DataError, match="no curve"):
        report.write_curves_csv(tmp_path / "c.csv", {})


def test_seeds_are_averaged_with_their_spread_and_other_cells_left_alone() -> None:
    single = [row(age=0.01 * k, seeds=(k,), age_std=None, exact_match=0.1 * k, seconds=10.0) for k in (1, 2, 3)]
    averaged, other = report.average_seeds([*single, row(test="FAUST 10000", seeds=(0,), age_std=None)])
    assert averaged.age == pytest.approx(0.02)
    assert averaged.age_std == pytest.approx(np.std([0.01, 0.02, 0.03], ddof=1))
    assert (averaged.seeds, averaged.seconds) == ((1, 2, 3), 30.0)
    assert averaged.exact_match == pytest.approx(0.2)
    assert (other.test, other.seeds) == ("FAUST 10000", (0,))
    by_class = [row(matching="argmax", seeds=(k,)) for k in (1, 2)]
    assert [r.matching for r in report.average_seeds([*single, *by_class])] == ["nearest", "argmax"]
    assert report.average_seeds([row(seeds=(1,), epochs=9), row(seeds=(2,), epochs=7)])[0].epochs == 7


@pytest.mark.parametrize("change", [{"seeds": (1,)}, {"protocol": "another"}, {"seeds": ()}])
def test_rows_that_are_no_repetition_have_no_mean(change: dict[str, object]) -> None:
    with pytest.raises(DataError, match="have no mean"):
        report.average_seeds([row(seeds=(1,)), row(**({"seeds": (2,)} | change))])
