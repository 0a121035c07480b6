"""The jobs of a sweep: their settings, what they returned, and how much each parameter accounts for."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import numpy as np

from csm.errors import DataError

MEAN_ERROR = "mean test error"
"""The quantity that jobs without held-out shapes are compared by: the mean of `age/...` over the test sets."""

_RESULT = "result.json"


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
        groups = by_value(known, name)
        mean = fmean(value for _, value in known)
        between = sum(len(group) * (fmean(group) - mean) ** 2 for group in groups.values()) / len(known)
        shares[name] = between / total if total > 0 else 0.0
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def by_value(known: Sequence[tuple[SweepJob, float]], name: str) -> dict[str, list[float]]:
    """Return the numbers of jobs for each value of a parameter, in the order of the values."""
    groups: dict[str, list[float]] = {}
    for job, value in sorted(known, key=lambda pair: _order(pair[0].settings.get(name, ""))):
        groups.setdefault(job.settings.get(name, ""), []).append(value)
    return groups
