"""The tables of the README, made from the json files under results/.

``make tables`` rewrites every block between ``<!-- table: FILE -->`` (result rows) or ``<!-- study: FILE -->`` (what
``csm reproduce`` found) and ``<!-- end -->``; a test compares them.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from csm.evaluation.report import ResultRow, read_rows
from csm.evaluation.tables import Published, markdown_table, paper_table
from csm.studies.published import LEARNED_AGE
from csm.studies.study import Findings

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- (table|study): (\S+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)

PUBLISHED: Published = {(m, test): age / 1000 for m, ages in LEARNED_AGE.items() for test, age in ages.items()}
"""Tables 4 and 5 of the paper, as fractions of the diameter."""


def tables(rows: list[ResultRow]) -> str:
    """Return the paper's errors beside ours, then our rows with their protocol."""
    protocols: dict[str, list[ResultRow]] = {}
    for row in rows:
        protocols.setdefault(row.protocol, []).append(row)
    lines = []
    for protocol, measured in protocols.items():
        tests, methods = (", ".join(dict.fromkeys(getattr(row, key) for row in measured)) for key in ("test", "method"))
        lines.append(f"{tests}{f' ({methods})' if len(protocols) > 1 else ''}: {protocol}")
    return f"{paper_table(rows, PUBLISHED)}\n{markdown_table(rows)}\n" + "\n\n".join(lines) + "\n"


def study(path: Path) -> str:
    """Return the table and the notes of a study."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    found = Findings(kept["name"], kept["title"], tuple(kept["columns"]), kept["rows"], tuple(kept["notes"]))
    return f"{found.markdown()}\n"


def with_tables(text: str) -> str:
    """Return the text with every block made anew."""
    return BLOCK.sub(lambda m: f"{m[1]}{_content(m[2], ROOT / m[3])}{m[5]}", text)


def _content(kind: str, path: Path) -> str:
    return study(path) if kind == "study" else tables(read_rows(path))


if __name__ == "__main__":
    readme = ROOT / "README.md"
    readme.write_text(with_tables(readme.read_text(encoding="utf-8")), encoding="utf-8")
