"""One page about a sweep: its jobs best first, what each parameter does, how the losses fell, and the best settings."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

import numpy as np

from csm._counts import counted
from csm._types import FloatArray
from csm.errors import ConfigError
from csm.experiments.sweeps import MEAN_ERROR, SweepJob, by_value, importance, read_sweep, varied
from csm.viewer.comparisons import Sweep, losses_figure, sweeps_figure
from csm.viewer.figures import figure_to_array
from csm.viewer.html import Code, Figure, Section, Table, Text, report_html, write_html

_SHOWN = ("status", "seconds", "train/loss", "val/age", "fit/age")
_SEED = "seed"
_QUOTED = re.compile(r"^(data\.root|data\.split|pretrained)=(['\"])([\w./-]+)\2$")
_MARK = "Made by csm sweep-report."


def write_sweep_report(folder: Path, out: Path, by: str | None = None) -> SweepJob:
    """Write the page of a sweep, and return the job with the smallest value.

    Parameters
    ----------
    folder
        Of the sweep: each job has a folder in it.
    out
        The page, ``.html``.
    by
        The number that jobs are compared by; the smallest is the best.  By default `val/age`, of training
        shapes that were held out, else `MEAN_ERROR`, else `fit/age`.

    Raises
    ------
    DataError
        If there are no jobs.
    ConfigError
        If no job has such a number.
    """
    jobs = read_sweep(folder)
    quantity = by or next(
        (q for q in ("val/age", MEAN_ERROR, "fit/age", "train/loss") if any(j.value(q) is not None for j in jobs)), ""
    )
    ranked = sorted(
        (job for job in jobs if job.value(quantity) is not None), key=lambda job: float(job.value(quantity) or 0)
    )
    if not ranked:
        known = ", ".join(sorted({name for job in jobs for name in job.numbers})) or "no numbers"
        failed = "" if any(job.status == "ok" for job in jobs) else f"; all jobs failed, the first: {jobs[0].error}"
        raise ConfigError(f"{folder}: no job has {quantity or MEAN_ERROR!r}; there are {known}{failed}")
    best, rest = ranked[0], [job for job in jobs if job not in ranked]
    sections = [
        Section("The best", [Text(_best_in_words(ranked, quantity)), Code(_command(best))]),
        Section("All jobs, best first", [_table([*ranked, *rest], quantity)]),
        *_effects(ranked, quantity),
        *_curves(ranked),
    ]
    lead = f"{counted(len(jobs), 'job')} in {folder.name}, compared by {quantity}; the smallest is the best."
    without = [job.name for job in rest if job.status == "ok"]
    if without:
        lead += f" Not compared, as they have no {quantity}: {counted(len(without), 'job')} ({', '.join(without)})."
    write_html(out, report_html("A sweep", sections, lead=lead, footer=_MARK))
    return best


def is_report(path: Path) -> bool:
    """Tell whether a file is a page that `write_sweep_report` has written."""
    return _MARK in path.read_text(encoding="utf-8", errors="replace")


def _best_in_words(ranked: Sequence[SweepJob], quantity: str) -> str:
    best = ranked[0]
    text = f"Job {best.name} has {quantity} {best.value(quantity):.4g}."
    if len(ranked) > 1:
        middle = ranked[len(ranked) // 2]
        text += f" The next has {ranked[1].value(quantity):.4g}"
        text += f", the middle one {middle.value(quantity):.4g}." if middle is not ranked[1] else "."
    seeds = {job.settings.get(_SEED) for job in ranked}
    if len(seeds) < 2:
        text += " With one seed, a small difference may be chance: repeat the best ones with seed=0,1,2."
    if quantity.startswith(("age/", MEAN_ERROR)):
        text += (
            " These are errors of test shapes, which promise too much of settings that were chosen by them; held out "
            "training shapes (data.holdout=10) give val/age to choose by."
        )
    return text


def _command(job: SweepJob) -> str:
    """Return what to type; csm puts a path in quotes itself, so those of a plain one are left out."""
    typed = (_QUOTED.sub(r"\1=\3", override) for override in job.overrides)
    return " ".join(["csm train", *map(shlex.quote, typed)])


def _table(jobs: Sequence[SweepJob], quantity: str) -> Table:
    parameters = list(varied(jobs))
    tests = list(dict.fromkeys(n for job in jobs for n in job.numbers if n.startswith("age/")))
    columns = ["job", *parameters, quantity, *[n for n in (*tests, *_SHOWN) if n != quantity]]
    rows = [
        [
            job.name,
            *(job.settings.get(p, "") for p in parameters),
            *(_cell(job, c) for c in columns[1 + len(parameters) :]),
        ]
        for job in jobs
    ]
    return Table(columns, rows)


def _cell(job: SweepJob, column: str) -> str:
    if column == "status":
        return job.status if job.status == "ok" else f"{job.status}: {job.error}"
    value = job.value(column)
    return "" if value is None else f"{value:.4g}"


def _effects(ranked: Sequence[SweepJob], quantity: str) -> list[Section]:
    shares = importance(ranked, quantity)
    if not shares:
        return []
    known = [(job, float(job.value(quantity) or 0)) for job in ranked]
    sweeps, rows = [], []
    for name, share in shares.items():
        groups = by_value(known, name)
        once = max(map(len, groups.values())) == 1  # such groups account for all variance, whatever they mean
        rows.append([name, "each value was tried once" if once else f"{100 * share:.0f} %"])
        means: FloatArray = np.array([fmean(group) for group in groups.values()])
        spread: FloatArray = np.array([np.std(group) / max(1, len(group) - 1) ** 0.5 for group in groups.values()])
        best = ranked[0].settings.get(name, "")
        sweeps.append(Sweep(name, list(groups), {quantity: (means, spread)}, best, ring="best job"))
    return [
        Section(
            "What each parameter does",
            [
                Table(["parameter", "share of the variance"], rows),
                Figure(
                    figure_to_array(sweeps_figure(sweeps, quantity)),
                    "Means over all other parameters, with standard errors; the ring is the best job.",
                ),
            ],
        )
    ]


def _curves(ranked: Sequence[SweepJob]) -> list[Section]:
    curves = {job.name: job.losses for job in ranked if job.losses}
    if not curves:
        return []
    return [Section("Training losses", [Figure(figure_to_array(losses_figure(curves)), "The best job is dark.")])]
