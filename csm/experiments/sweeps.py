"""One page about a sweep: its jobs best first, what each parameter does, how the losses fell, and the best settings."""

from __future__ import annotations

import json
import logging
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import numpy as np

from csm._counts import counted
from csm._types import FloatArray
from csm.errors import ConfigError, DataError
from csm.viewer.comparisons import Sweep, losses_figure, sweeps_figure
from csm.viewer.figures import figure_to_array
from csm.viewer.html import Code, Figure, Section, Table, Text, report_html, write_html

MEAN_ERROR = "mean test error"
"""The quantity that jobs without held-out shapes are compared by: the mean of `age/...` over the test sets."""

_RESULT = "result.json"
_SHOWN = ("status", "seconds", "train/loss", "val/age", "fit/age")
_SEED = "seed"
_QUOTED = re.compile(r"^(data\.root|data\.split|pretrained)=(['\"])([\w./-]+)\2$")
_MARK = "Made by csm sweep-report."


@dataclass(frozen=True)
class SweepJob:
    """One job of a sweep.

    Parameters
    ----------
    name
        Of its folder.
    settings
        The options that were given for it.
    numbers
        What it returned.
    status, error
        "ok" or "failed", and why.
    losses
        The training loss of each epoch, empty where there is no log.
    overrides
        The options as they were typed.
    """

    name: str
    settings: Mapping[str, str]
    numbers: Mapping[str, float]
    status: str = "ok"
    error: str = ""
    losses: tuple[float, ...] = ()
    overrides: tuple[str, ...] = ()

    def value(self, quantity: str) -> float | None:
        """Return a quantity of the job: a finite number that it returned, or `MEAN_ERROR`; None if it has none."""
        wanted = [name for name in self.numbers if name.startswith("age/")] if quantity == MEAN_ERROR else [quantity]
        values = [self.numbers.get(name, np.nan) for name in wanted]
        found = fmean(values) if values else np.nan
        return found if np.isfinite(found) else None


def read_sweep(folder: Path) -> list[SweepJob]:
    """Return the jobs of a sweep, in the order of their numbers.

    Raises
    ------
    DataError
        If there are none.
    """
    files = sorted(folder.glob(f"*/{_RESULT}"), key=lambda path: (len(path.parent.name), path.parent.name))
    if not files:
        single = (folder / _RESULT).is_file()
        what = "this is one training, not a sweep" if single else f"there are no jobs with {_RESULT}"
        raise DataError(f"{folder}: {what}; wanted the folder of a sweep, such as outputs/train_sweep/DATE")
    return [_job(path) for path in files]


def _job(path: Path) -> SweepJob:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DataError(f"{path}: not a result of a job ({error})") from error
    if not isinstance(record, dict) or "status" not in record:
        raise DataError(f"{path}: not a result of a job: it has no status")
    overrides = [str(text) for text in record.pop("overrides", ())]
    numbers = {key: float(value) for key, value in record.items() if isinstance(value, int | float)}
    return SweepJob(
        path.parent.name,
        given(overrides),
        numbers,
        str(record.get("status", "ok")),
        str(record.get("error", "")),
        tuple(_losses(path.parent)),
        tuple(overrides),
    )


def given(overrides: Sequence[str]) -> dict[str, str]:
    """Return key -> value of the options of a job as they were typed.

    Examples
    --------
    >>> given(["+seed=1", "data.root='a=b'", "~callbacks.panels"])
    {'seed': '1', 'data.root': 'a=b'}
    """
    pairs = (text.lstrip("+~").split("=", 1) for text in overrides if "=" in text)
    return {key: value.strip("'") for key, value in pairs}


def _losses(folder: Path) -> list[float]:
    """Return the mean training loss of each epoch from the log of TensorBoard, if there is one."""
    places = {path.parent for path in folder.rglob("events.out.tfevents.*")}
    if not places:
        return []
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    logging.getLogger("tensorboard").setLevel(logging.WARNING)  # else it names every log whose end it has reached
    log = EventAccumulator(str(min(places)), size_guidance={"scalars": 0, "images": 1, "tensors": 1}).Reload()
    if not {"train/loss", "epoch"} <= set(log.Tags()["scalars"]):
        return []
    epochs = {event.step: int(event.value) for event in log.Scalars("epoch")}
    found: dict[int, list[float]] = {}
    for event in log.Scalars("train/loss"):
        if event.step in epochs:
            found.setdefault(epochs[event.step], []).append(event.value)
    return [fmean(found[epoch]) for epoch in sorted(found)]


def varied(jobs: Sequence[SweepJob]) -> dict[str, list[str]]:
    """Return the parameters that take more than one value in a sweep, with the values in order."""
    names = dict.fromkeys(name for job in jobs for name in job.settings)
    values = {name: sorted({job.settings.get(name, "") for job in jobs}, key=_order) for name in names}
    return {name: found for name, found in values.items() if len(found) > 1}


def _order(text: str) -> tuple[int, float, str]:
    try:
        return 0, float(text), text
    except ValueError:
        return 1, 0.0, text


def importance(jobs: Sequence[SweepJob], quantity: str) -> dict[str, float]:
    """Return the share of a quantity's variance that the means over each parameter's values account for, largest first.

    Between 0 and 1.  Parameters of a full grid share the whole among themselves and their interactions.
    """
    known = [(job, value) for job in jobs if (value := job.value(quantity)) is not None]
    total = float(np.var([value for _, value in known])) if known else 0.0
    shares = {}
    for name in varied([job for job, _ in known]):
        groups = _groups(known, name)
        mean = fmean(value for _, value in known)
        between = sum(len(group) * (fmean(group) - mean) ** 2 for group in groups.values()) / len(known)
        shares[name] = between / total if total > 0 else 0.0
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _groups(known: Sequence[tuple[SweepJob, float]], name: str) -> dict[str, list[float]]:
    groups: dict[str, list[float]] = {}
    for job, value in sorted(known, key=lambda pair: _order(pair[0].settings.get(name, ""))):
        groups.setdefault(job.settings.get(name, ""), []).append(value)
    return groups


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
        groups = _groups(known, name)
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
