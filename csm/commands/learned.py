"""``csm reproduce table4 figure9 ...``: matrices of learned methods as studies, beside the numbers of the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from hydra import compose
from omegaconf import DictConfig, OmegaConf

from csm.commands import matrix
from csm.evaluation.report import read_rows
from csm.studies.learned import curves, dots, findings, sweeps
from csm.studies.study import Context, Findings
from csm.viewer.figures import save_figure


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
        Curves, with a panel per test set; all mean errors as dots; or the mean errors over the options in which rows
        differ from the first.
    """

    purpose: str
    experiment: str
    cells: str
    picture: Literal["dots", "curves", "sweeps"]


LEARNED: Mapping[str, LearnedStudy] = {
    "table4": LearnedStudy("errors of the learned methods on FAUST at three resolutions", "table4", "faust", "dots"),
    "table5": LearnedStudy("errors of the learned methods on SCAPE", "table5", "scape", "dots"),
    "figure7": LearnedStudy("share of points within an error, the methods of table4", "table4", "faust", "curves"),
    "figure8": LearnedStudy("share of points within an error, the methods of table5", "table5", "scape", "curves"),
    "figure9": LearnedStudy("ACD fed to MGCN, DiffusionNet and CSMCNN", "figure9", "faust", "curves"),
    "figure11": LearnedStudy("ACD alone, with a perceptron and with CSMCNN", "figure11", "faust", "curves"),
    "coarse": LearnedStudy("the methods of table4 on 1000 vertices, hardly cut short", "coarse", "coarse", "dots"),
    "humans_table": LearnedStudy("the methods of table4 on the built-in humans", "humans_table", "humans", "dots"),
    "ablation": LearnedStudy("K_s, terms and normalisation of CSMCNN", "ablation", "ablation", "sweeps"),
}
"""The studies that train networks, by name."""

_LABELS = {"model.ks": "eigenpairs $K_s$", "model.terms": "terms", "model.momentum": "BatchNorm momentum"}


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
    wanted = compose("matrix", overrides=[*fixed, *cfg[name].overrides])
    matrix.run(wanted)
    rows = read_rows(folder / f"{study.experiment}.json")
    nearest = [row for row in rows if "," not in row.method]
    picture = context.out / f"{name}.png"
    if study.picture == "sweeps":
        figure = sweeps(nearest, varied(wanted.rows))
    else:
        figure = dots(nearest) if study.picture == "dots" else curves(folder, nearest)
    save_figure(picture, figure)
    return findings(name, rows, [picture])


def varied(rows: Mapping[str, Sequence[str]]) -> dict[str, dict[float | str, str]]:
    """Return what the rows of a matrix change against the first: label of the option -> value -> row, the first first.

    Every other row has the overrides of the first and one more.
    """
    (preset, common), *others = rows.items()
    start = compose("train", overrides=list(common))
    found: dict[str, dict[float | str, str]] = {}
    for row, overrides in others:
        (change,) = overrides[len(common) :]
        key = change.partition("=")[0]
        values = found.setdefault(_LABELS.get(key, key.rpartition(".")[2]), {OmegaConf.select(start, key): preset})
        values[OmegaConf.select(OmegaConf.from_dotlist([change]), key)] = row
    return found
