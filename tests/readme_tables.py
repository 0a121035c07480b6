"""The tables of the README, made from the json files under results/.

``make tables`` rewrites every block between ``<!-- study: FILE -->`` (what ``csm reproduce`` found) and
``<!-- end -->``; a test compares them.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from csm.studies.study import Findings

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- study: (\S+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def study(path: Path) -> str:
    """Return the table and the notes of a study."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    found = Findings(kept["name"], kept["title"], tuple(kept["columns"]), kept["rows"], tuple(kept["notes"]))
    return f"{found.markdown()}\n"


def with_tables(text: str) -> str:
    """Return the text with every block made anew."""
    return BLOCK.sub(lambda m: f"{m[1]}{study(ROOT / m[2])}{m[4]}", text)


if __name__ == "__main__":
    readme = ROOT / "README.md"
    readme.write_text(with_tables(readme.read_text(encoding="utf-8")), encoding="utf-8")
