"""``csm reproduce table4 table5``: the matrices of learned methods as studies, with the paper's numbers and curves."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hydra import compose
from omegaconf import DictConfig

from csm.commands import matrix
from csm.evaluation.report import ResultRow, read_rows
from csm.evaluation.tables import error_cell
from csm.studies.published import LEARNED_AGE
from csm.studies.study import Context, Findings
from csm.viewer.figures import Curve, cqc_figure, save_figure

PURPOSES: Mapping[str, str] = {
    "table4": "errors of the learned methods on FAUST at three resolutions (and figure 7)",
    "table5": "errors of the learned methods on SCAPE (and figure 8)",
}
"""The learned tables, each the experiment of ``csm matrix`` that has its name, and what they show."""

_FIGURES = {"table4": "figure7", "table5": "figure8"}


def make(cfg: DictConfig, context: Context, name: str) -> Findings:
    """Fill the cells of a matrix that are missing, and put them beside the paper's.

    Parameters
    ----------
    cfg
        Of ``csm reproduce``; its section `name` has `overrides` of ``csm matrix``, such as ``seeds=[0]``.
    context
        Where artefacts are: the matrix lies in the folder `name` there.
    name
        Out of `PURPOSES`.
    """
    folder = context.out / name
    fixed = [f"experiment={name}", f"folder={folder}", "results=null", f"store={context.store.root}"]
    matrix.run(compose("matrix", overrides=[*fixed, *cfg[name].overrides]))
    return findings(name, folder, read_rows(folder / "table.json"))


def findings(name: str, folder: Path, rows: Sequence[ResultRow]) -> Findings:
    """Return a filled matrix as findings, with one picture of curves per test set."""
    lines: dict[str, dict[str, Any]] = {}
    for row in rows:
        line = lines.setdefault(row.method, {"method": row.method, "seeds": _text(row.seeds), "epochs": row.epochs})
        line[f"{row.test} paper"] = LEARNED_AGE.get(row.method, {}).get(row.test)
        line[row.test] = error_cell(row)
        line[f"{row.test} exact %"] = 100 * row.exact_match
        line.setdefault("rows", []).append({key: getattr(row, key) for key in ("age", "age_std", "p95", "auc", "test")})
    tests = list(dict.fromkeys(row.test for row in rows))
    shown = [column for test in tests for column in (f"{test} paper", test, f"{test} exact %")]
    title = f"Mean geodesic error of learned methods in thousandths of the diameter, trained on {rows[0].train}."
    notes = [f"{row.test}: {row.protocol}" for row in {row.test: row for row in rows}.values()]
    notes.append("Rows with argmax are matched through the classifier, the others by the nearest learned descriptor.")
    pictures = tuple(_picture(name, folder, test, rows) for test in tests)
    return Findings(name, title, ("method", *shown, "seeds", "epochs"), list(lines.values()), tuple(notes), pictures)


def _picture(name: str, folder: Path, test: str, rows: Sequence[ResultRow]) -> Path:
    curves = {row.method: _curve(folder, row) for row in rows if row.test == test}
    path = folder / f"{_FIGURES.get(name, name)}_{test}.png"
    save_figure(path, cqc_figure(curves))
    return path


def _curve(folder: Path, row: ResultRow) -> Curve:
    """Average the curves of a row's seeds, which the matrix keeps beside its cells."""
    method, _, matching = row.method.partition(", ")
    file = f"{row.test}_{row.distance}_{row.normaliser}{f'_{matching}' if matching else ''}.cqc.csv"
    tables = []
    for seed in row.seeds:
        with (folder / method / f"seed{seed}" / file).open(newline="", encoding="utf-8") as opened:
            tables.append(np.array([[float(cell) for cell in line] for line in list(csv.reader(opened))[1:]]))
    thresholds, fractions = np.mean(tables, axis=0).T
    return Curve(thresholds, fractions, row.age)


def _text(seeds: Sequence[int]) -> str:
    return " ".join(map(str, seeds))
