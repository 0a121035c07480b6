"""`csm check FOLDER`: what is wrong with the meshes of a folder, which set it is, and what is missing."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm.commands.app import command
from csm.data.folders import FolderSet, Missing
from csm.data.inspection import Inspected, inspect
from csm.data.registry import recognise
from csm.errors import ConfigError, DataError


@dataclass(frozen=True, eq=False)
class Report:
    """A recognised set with what was found about each shape; `str` gives the table for people.

    Parameters
    ----------
    shapes
        The set.
    rows
        One row per shape, in the set's order.
    """

    shapes: FolderSet
    rows: tuple[Inspected, ...]

    @property
    def n_unusable(self) -> int:
        """Number of shapes that operators cannot be built on or whose map cannot be read."""
        return sum(not row.usable for row in self.rows)

    def __str__(self) -> str:
        return "\n".join([*_table(self.rows), "", *_summary(self), *_what_is_missing(self.shapes.missing)])


def run(cfg: DictConfig) -> dict[str, Any]:
    """Check the folder of the configuration and print the table; DataError if a shape cannot be used."""
    if cfg.folder is None:
        raise ConfigError("check needs a folder of meshes: csm check FOLDER")
    report = check_folder(Path(cfg.folder))
    print(report)
    if report.n_unusable:
        raise DataError(f"{cfg.folder}: {report.n_unusable} of {len(report.rows)} shapes cannot be used, see the table")
    return {"shapes": len(report.rows), "missing": len(report.shapes.missing)}


def check_folder(folder: Path, progress: bool = True) -> Report:
    """Recognise a folder and check all its shapes; nothing is changed or downloaded.

    Raises
    ------
    csm.errors.DataError
        If there are no meshes in the folder.
    """
    shapes = recognise(folder)
    return Report(shapes, inspect(shapes, progress))


def _table(rows: Sequence[Inspected]) -> list[str]:
    width = max([len(row.name) for row in rows] + [len("shape")])
    lines = [f"{'shape':<{width}}  {'vertices':>8}  {'faces':>8}  {'area':>10}  findings"]
    for row in rows:
        sizes = f"{row.n_vertices:>8}  {row.n_faces:>8}  {row.area:>10.4g}" if row.n_vertices else f"{'':>30}"
        lines.append(f"{row.name:<{width}}  {sizes}  {_findings(row)}")
    return lines


def _findings(row: Inspected) -> str:
    marked = [("ERROR " if f.severity == "error" else "") + f.text for f in row.findings]
    return "; ".join([*(f"ERROR {problem}" for problem in row.problems), *marked]) or "-"


def _summary(report: Report) -> list[str]:
    shapes, rows = report.shapes, report.rows
    noted = sum(bool(row.findings) for row in rows if row.usable)
    lines = [
        f"{shapes.root}: {shapes.layout.title}, called {shapes.name}",
        f"{len(rows)} shapes, {len(shapes.mapped)} with correspondence; {report.n_unusable} cannot be used, "
        f"{noted} usable with notes",
    ]
    if shapes.pairs:
        lines.append(f"{len(shapes.pairs)} test pairs, {len(shapes.mapped_pairs)} with both maps")
    lines += [f"list {name}: {len(names)} shapes" for name, names in shapes.lists.items()]
    return lines


def _what_is_missing(missing: Sequence[Missing]) -> list[str]:
    if not missing:
        return ["nothing is missing"]
    lines = [f"{len(missing)} files are missing:"]
    for origin in dict.fromkeys(m.origin for m in missing):
        names = ", ".join(m.path for m in missing if m.origin == origin)
        lines += textwrap.wrap(names, 110, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)
        lines.append(f"  to be had from: {origin}")
    return lines


main = command("check")(run)

if __name__ == "__main__":
    main()
