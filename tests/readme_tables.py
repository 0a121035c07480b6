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
from csm.studies.study import Findings

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- (table|study): (\S+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)

TABLE4 = {"FAUST_6890": 0.010, "FAUST_10000": 0.015, "FAUST_15000": 0.017}
"""Row CSMCNN of the paper's Table 4, as fractions of the diameter."""

PUBLISHED: Published = {
    **{(method, test): age for method in ("faust_paper", "faust_release") for test, age in TABLE4.items()},
    ("scape_paper", "SCAPE_5000"): 0.022,  # the paper's Table 5
}


def tables(rows: list[ResultRow]) -> str:
    """Return the paper's errors beside ours, then our rows with their protocol."""
    protocols: dict[str, list[str]] = {}
    for row in rows:
        protocols.setdefault(row.protocol, []).append(row.test)
    lines = [f"{', '.join(dict.fromkeys(tests))}: {protocol}" for protocol, tests in protocols.items()]
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
