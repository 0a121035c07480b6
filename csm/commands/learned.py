"""``csm reproduce table4 figure9 ...``: matrices of learned methods as studies, beside the numbers of the paper."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from hydra import compose
from matplotlib.figure import Figure
from omegaconf import DictConfig

from csm.commands import matrix
from csm.evaluation.report import ResultRow, read_rows
from csm.evaluation.tables import error_cell
from csm.studies.contenders import row_title
from csm.studies.published import LEARNED_AGE
from csm.studies.study import Context, Findings
from csm.viewer.comparisons import curve_panels, dots_figure
from csm.viewer.figures import Curve, save_figure


@dataclass(frozen=True)
class LearnedStudy:
    """A table or figure of trained networks.

    Parameters
    ----------
    purpose
        What it shows, for ``--help``.
    experiment
        Of ``csm matrix``.
    cells
        Folder of the trained networks, below that of the artefacts; studies that name the same one share rows.
    picture
        Curves, with a panel per test set, or all mean errors as dots.
    """

    purpose: str
    experiment: str
    cells: str
    picture: Literal["dots", "curves"]


LEARNED: Mapping[str, LearnedStudy] = {
    "table4": LearnedStudy("errors of the learned methods on FAUST at three resolutions", "table4", "faust", "dots"),
    "table5": LearnedStudy("errors of the learned methods on SCAPE", "table5", "scape", "dots"),
    "figure7": LearnedStudy("share of points within an error, the methods of table4", "table4", "faust", "curves"),
    "figure8": LearnedStudy("share of points within an error, the methods of table5", "table5", "scape", "curves"),
    "figure9": LearnedStudy("ACD fed to MGCN, DiffusionNet and CSMCNN", "figure9", "faust", "curves"),
    "figure11": LearnedStudy("ACD alone, with a perceptron and with CSMCNN", "figure11", "faust", "curves"),
    "coarse": LearnedStudy("the methods of table4 with all their epochs, on 1000 vertices", "coarse", "coarse", "dots"),
    "ablation": LearnedStudy("K_s, terms and normalisation of CSMCNN", "ablation", "ablation", "dots"),
}
"""The studies that train networks, by name."""


def make(cfg: DictConfig, context: Context, name: str) -> Findings:
    """Fill the cells of a matrix that are missing, and put them beside the paper's.

    Parameters
    ----------
    cfg
        Of ``csm reproduce``; its section `name` has `overrides` of ``csm matrix``, such as ``seeds=[0]``.
    context
        Where artefacts are.
    name
        Out of `LEARNED`.
    """
    study = LEARNED[name]
    folder = context.out / study.cells
    fixed = [f"experiment={study.experiment}", f"folder={folder}", "results=null", f"store={context.store.root}"]
    matrix.run(compose("matrix", overrides=[*fixed, *cfg[name].overrides]))
    rows = read_rows(folder / f"{study.experiment}.json")
    draw = dots if study.picture == "dots" else curves
    picture = context.out / f"{name}.png"
    save_figure(picture, draw(folder, [row for row in rows if "," not in row.method]))
    return findings(name, rows, [picture])


def findings(name: str, rows: Sequence[ResultRow], pictures: Sequence[Path] = ()) -> Findings:
    """Return the rows of a filled matrix as findings, the paper's error beside ours where it has one."""
    lines: dict[str, dict[str, Any]] = {}
    for row in rows:
        known = {"method": row_title(row.method), "row": row.method, "seeds": _text(row.seeds), "epochs": row.epochs}
        line = lines.setdefault(row.method, known)
        line[f"{row.test} paper"] = LEARNED_AGE.get(row.method, {}).get(row.test)
        line[row.test] = error_cell(row)
        line[f"{row.test} exact %"] = 100 * row.exact_match
        line.setdefault("rows", []).append({key: getattr(row, key) for key in ("age", "age_std", "p95", "auc", "test")})
    tests = list(dict.fromkeys(row.test for row in rows))
    shown = [column for test in tests for column in (f"{test} paper", test, f"{test} exact %")]
    title = f"Mean geodesic error of learned methods in thousandths of the diameter, trained on {rows[0].train}."
    notes = [f"{row.test}: {row.protocol}" for row in {row.test: row for row in rows}.values()]
    notes.append("Rows with argmax are matched through the classifier, the others by the nearest learned descriptor.")
    columns = ("method", *shown, "seeds", "epochs")
    return Findings(name, title, columns, list(lines.values()), tuple(notes), tuple(pictures))


def dots(_: Path, rows: Sequence[ResultRow]) -> Figure:
    """Return a picture of the mean errors, with a kind of dot per test set."""
    ages = {(row.method, row.test): 1000 * row.age for row in rows}
    methods, tests = (list(dict.fromkeys(key[i] for key in ages)) for i in (0, 1))
    values = {test: [ages.get((method, test), float("nan")) for method in methods] for test in tests}
    names = [row_title(method) for method in methods]
    return dots_figure(names, {"mean error (thousandths of the diameter)": values})


def curves(folder: Path, rows: Sequence[ResultRow]) -> Figure:
    """Return a picture of the shares of points within an error, with a panel per test set."""
    panels: dict[str, dict[str, Curve]] = {row.test: {} for row in rows}
    for row in rows:
        panels[row.test][row_title(row.method)] = _curve(folder, row)
    return curve_panels(panels)


def _curve(folder: Path, row: ResultRow) -> Curve:
    """Average the curves of a row's seeds, which the matrix keeps beside its cells."""
    file = f"{row.test}_{row.distance}_{row.normaliser}.cqc.csv"
    tables = []
    for seed in row.seeds:
        with (folder / row.method / f"seed{seed}" / file).open(newline="", encoding="utf-8") as opened:
            tables.append(np.array([[float(cell) for cell in line] for line in list(csv.reader(opened))[1:]]))
    thresholds, fractions = np.mean(tables, axis=0).T
    return Curve(thresholds, fractions, row.age)


def _text(seeds: Sequence[int]) -> str:
    return " ".join(map(str, seeds))
