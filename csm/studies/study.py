"""What a study is given and what it leaves behind."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from csm.data.store import Store
from csm.evaluation.provenance import Provenance
from csm.mesh.io import atomic_path

MEAN_ERROR = "mean error (thousandths of the diameter)"
"""The label of the axis that most figures share."""


@dataclass(frozen=True, eq=False)
class Context:
    """Where a study finds its data and may keep what it has made.

    Parameters
    ----------
    root
        Folder of the data sets (a set is found anywhere below it, see `csm.data.folder`).
    out
        Folder of the artefacts; what is finished there is not made again.
    store
        Of operators and descriptors.
    workers
        Processes to use.
    seed
        Of every draw.
    """

    root: Path
    out: Path
    store: Store
    workers: int = 1
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Findings:
    """What a study found.

    Parameters
    ----------
    name
        Such as "table1".
    title
        One sentence: what is measured, on what.
    columns
        Keys of the rows that the table shows, in order.
    rows
        Plain data, all that the json holds; values that a table shows are texts, integers or floats.
    notes
        Sentences to read beside the numbers: protocol, assumptions, what differs from the paper and why.
    pictures
        Files that the study has written.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: Sequence[dict[str, Any]]
    notes: tuple[str, ...] = ()
    pictures: tuple[Path, ...] = field(default=())

    def markdown(self) -> str:
        """Return title, table and notes.

        Examples
        --------
        >>> print(Findings("t", "A title.", ("a", "b"), [{"a": 1, "b": 0.25}]).markdown())
        A title.
        <BLANKLINE>
        | a | b |
        |---|---|
        | 1 | 0.25 |
        """
        lines = ["| " + " | ".join(self.columns) + " |", "|" + "---|" * len(self.columns)]
        lines += ["| " + " | ".join(_cell(row.get(column)) for column in self.columns) + " |" for row in self.rows]
        return "\n".join([self.title, "", *lines, *(f"\n{note}" for note in self.notes)])

    def csv(self) -> str:
        """Return the shown columns as comma-separated values."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([_cell(row.get(column)) for column in self.columns] for row in self.rows)
        return text.getvalue()


def write_findings(findings: Findings, out: Path, made: Provenance, seconds: float) -> list[Path]:
    """Write NAME.json, NAME.csv and NAME.md into `out`, each under a temporary name first, and return their paths."""
    record = {
        "name": findings.name,
        "title": findings.title,
        "notes": list(findings.notes),
        "pictures": [path.name for path in findings.pictures],
        **asdict(made),
        "seconds": round(seconds, 1),
        "columns": list(findings.columns),
        "rows": list(findings.rows),
    }
    texts = {
        "json": json.dumps(record, indent=1, allow_nan=False, ensure_ascii=False) + "\n",
        "csv": findings.csv(),
        "md": findings.markdown() + "\n",
    }
    paths = []
    for suffix, text in texts.items():
        paths.append(out / f"{findings.name}.{suffix}")
        with atomic_path(paths[-1]) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return paths


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)
