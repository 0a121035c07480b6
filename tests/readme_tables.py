"""The tables of the README, made from the json files under results/.

``make tables`` rewrites every block between ``<!-- table: FILE -->`` (result rows) or ``<!-- study: FILE -->`` (what
``csm reproduce`` found) and ``<!-- end -->``; a test compares them.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from csm.evaluation.report import read_rows
from csm.studies.learned import findings
from csm.studies.study import Findings

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- (table|study): (\S+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def study(path: Path) -> str:
    """Return the table and the notes of a study."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    found = Findings(kept["name"], kept["title"], tuple(kept["columns"]), kept["rows"], tuple(kept["notes"]))
    return f"{found.markdown()}\n"


def with_tables(text: str) -> str:
    """Return the text with every block made anew."""
    return BLOCK.sub(lambda m: f"{m[1]}{_content(m[2], ROOT / m[3])}{m[5]}", text)


def _content(kind: str, path: Path) -> str:
    return study(path) if kind == "study" else f"{findings(path.stem, read_rows(path)).markdown()}\n"


if __name__ == "__main__":
    readme = ROOT / "README.md"
    readme.write_text(with_tables(readme.read_text(encoding="utf-8")), encoding="utf-8")
