"""The tables of README.md and docs/, made from the json files under results/.

``make tables`` rewrites every block between ``<!-- study: FILE -->`` (what ``csm reproduce`` found),
``<!-- benchmark: FILE -->`` (what a script of benchmarks/ measured), ``<!-- headline -->`` (a few numbers of Tables 1
and 4), ``<!-- goals -->`` (of speed and memory) or ``<!-- layouts -->`` (where data sets are published) and ``<!-- end
-->``; a test compares them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path

from csm.data.registry import layouts
from csm.reproduction.study import Findings
from tests import goals

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- (?:(study|benchmark): (\S+)|headline|goals|layouts) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
MEASURED = {
    "work": ("", "{}"),
    "variant": ("", "{}"),
    "vertices": ("vertices", "{:,}"),
    "classes": ("template points", "{:,}"),
    "reference_ms": ("reference ms", "{:.0f}"),
    "csm_ms": ("csm ms", "{:.0f}"),
    "queries": ("vertices", "{:,}"),
    "milliseconds": ("ms", "{:.0f}"),
    "acd_paper_s": ("ACD s", "{:.1f}"),
    "functions_s": ("128 functions s", "{:.1f}"),
    "seconds": ("s", "{:.1f}"),
    "processor_seconds": ("processor s", "{:.1f}"),
    "factored_s": ("factored s", "{:.1f}"),
    "ours_s": ("from a coarse mesh s", "{:.1f}"),
    "eigenvalues": ("eigenvalues differ by", "{:.0e}"),
    "descriptor": ("descriptor by", "{:.0e}"),
    "ratio": ("ratio", "{:.2f}"),
    "speedup": ("ratio", "{:.2f}"),
    "of_products": ("of the products", "{:.2f}"),
    "goal": ("goal", "{:.4g}"),
    "pairs": ("pairs", "{}"),
    "error": ("error", "{:.1f}"),
    "rest": ("rest of the step %", "{:.0f}"),
    "factor_share": ("factor %", "{:.0f}"),
    "solve_share": ("solve %", "{:.0f}"),
    "check_share": ("check %", "{:.0f}"),
    "megabytes": ("MB", "{:.0f}"),
    "logits": ("MB of all scores", "{:.0f}"),
    "wrong": ("wrong partners", "{:.4f}"),
}
"""What the rows of benchmarks have -> title of the column, and how its numbers are written; other things stay out."""
UNTRAINED = {"acd": "ACD", "asmwd": "ASMWD, the next best of eleven families"}
REFINED = "ACD, refined: the default of `csm match` [^1]"
OWN = "csm's own network, `experiment=faust` [^2]"
BEGUN = "the same, begun with the network that csm brings (`pretrained=humans`)"
TRAINED = {"faust_paper": "CSMCNN", "faust_acscnn": "ACSCNN, the paper's best at 6,890"}


def headline() -> str:
    """Return the errors of the best descriptors and of two networks across resolutions, in two small tables."""
    table1, table4 = (
        json.loads((ROOT / f"results/{name}.json").read_text(encoding="utf-8")) for name in ("table1", "table4")
    )
    sets = {"faust": "FAUST", "shrec19": "SHREC'19", "tosca": "TOSCA"}
    lines = _head("without training", sets.values())
    for name, method in UNTRAINED.items():
        (row,) = (row for row in table1["rows"] if row["descriptor"] == name)
        lines.append(_line(method, [row[key]["age"] for key in sets]))
        if name == "acd":
            lines.append(_line(REFINED, [_refined(key, title) for key, title in sets.items()]))
    lines += ["", *_head("trained on FAUST at 6,890 vertices, tested at", ["6,890", "10,000", "15,000"])]
    for name, title in TRAINED.items():
        (row,) = (row for row in table4["rows"] if row["row"] == name)
        lines.append(_line(title, [cell["age"] for cell in row["rows"] if _is_nearest(cell)]))
    for name, title in (("own", OWN), ("own_pretrained", BEGUN)):
        rows = json.loads((ROOT / f"results/{name}.json").read_text(encoding="utf-8"))
        lines.append(_line(title, [row["age"] for row in rows if row["train"] == "FAUST_6890"]))
    return "\n".join(lines) + "\n"


def published() -> str:
    """Return every form in which data sets are published, and where."""
    origins = ((each.title, re.sub(r"(https?://[^\s,]+)", r"<\1>", each.origin)) for each in layouts())
    rows = (f"| {title} | {origin} |" for title, origin in origins)
    return "\n".join([*_head("what csm recognises", ["where it is published, and on what terms"]), *rows]) + "\n"


def _refined(key: str, title: str) -> float:
    """Return the error on a set after the refinement that is the default of a match."""
    ending = "" if key == "faust" else f"_{key}"
    rows = json.loads((ROOT / f"results/refinement{ending}.json").read_text(encoding="utf-8"))["rows"]
    (age,) = (row[f"{title} summary"]["age"] for row in rows if row["map"] == "nearest+multistart")
    return float(age)


def _is_nearest(cell: dict[str, object]) -> bool:
    """Tell rows of the nearest descriptor from those of the classifier, also in files of the first format."""
    return cell.get("matching", "nearest") == "nearest" and ", " not in str(cell["method"])


def _head(first: str, others: Iterable[str]) -> list[str]:
    titles = [first, *others]
    return [f"| {' | '.join(titles)} |", "|" + "---|" * len(titles)]


def _line(title: str, ages: list[float]) -> str:
    return "| " + " | ".join([title, *(f"{1000 * age:.1f}" for age in ages)]) + " |"


def study(path: Path) -> str:
    """Return the table and the notes of a study."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    found = Findings(kept["name"], kept["title"], tuple(kept["columns"]), kept["rows"], tuple(kept["notes"]))
    return f"{found.markdown()}\n"


def benchmark(path: Path) -> str:
    """Return the rows of a benchmark, and a line that says with how many threads and how often it was measured."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    keys = [key for key in MEASURED if key in kept["rows"][0]]
    head = _head(MEASURED[keys[0]][0], (MEASURED[key][0] for key in keys[1:]))
    lines = [f"| {' | '.join(_written(key, row[key]) for key in keys)} |" for row in kept["rows"]]
    threads, repeats = (f"{kept[key]} {key[:-1] if kept[key] == 1 else key}" for key in ("threads", "repeats"))
    return "\n".join([*head, *lines, "", f"{threads}, {repeats}; `{kept['command']}`"]) + "\n"


def _written(key: str, value: object) -> str:
    return "" if value is None else MEASURED[key][1].format(value)


def with_tables(text: str) -> str:
    """Return the text with every block made anew."""
    of_file = {"study": study, "benchmark": benchmark}
    fixed = {"headline": headline, "layouts": published, "goals": lambda: goals.table(ROOT / "results")}

    def filled(found: re.Match[str]) -> str:
        begin, kind, path, _, end = found.groups()
        made = of_file[kind](ROOT / path) if kind else fixed[begin.split()[1]]()
        return f"{begin}{made}{end}"

    return BLOCK.sub(filled, text)


PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

if __name__ == "__main__":
    for page in PAGES:
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")
