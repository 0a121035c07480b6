"""The table of a multirun: one csv with the overrides and the numbers of every job."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from csm.mesh.io import atomic_path


class SweepTable(Callback):
    """After a multirun, gather every job's ``result.json`` into ``sweep.csv``; status 2 if a job failed."""

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Write the table, print it, and name the jobs that failed."""
        folder = Path(config.hydra.sweep.dir)
        rows = [_row(path) for path in sorted(folder.glob("*/result.json"), key=_job_number)]
        if not rows:
            return
        write_csv(folder / "sweep.csv", rows)
        print(f"table of {len(rows)} jobs: {folder / 'sweep.csv'}")
        failed = [row for row in rows if row["status"] != "ok"]
        for row in failed:
            print(f"csm: job {row['job']} failed: {row['error']}", file=sys.stderr)
        if failed:
            sys.exit(2)


def _job_number(path: Path) -> tuple[int, str]:
    name = path.parent.name
    return (int(name) if name.isdigit() else sys.maxsize, name)


def _row(path: Path) -> dict[str, Any]:
    from csm.experiments.sweeps import given  # every command has this callback, and few end a sweep

    record = json.loads(path.read_text())
    record.pop("settings", None)
    return {"job": path.parent.name, **given(record.pop("overrides", ())), **record}


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write rows with differing keys as one table; the columns come in the order of first appearance."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
