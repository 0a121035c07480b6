"""`csm check FOLDER`, `csm check a.off b.ply`: what is wrong with meshes, which set it is, and what is missing."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import os
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm.commands.app import command
from csm.data.folders import FolderSet, Missing, SameFaces
from csm.data.inspection import Inspected, inspect
from csm.data.registry import find_sets, layouts, recognise
from csm.errors import ConfigError, CsmError, DataError
from csm.matching.subjects import subject_of
from csm.mesh.check import Finding, require_usable
from csm.mesh.io import READABLE
from csm.mesh.io.listing import listed_meshes

_NO_MESHES = f"there are no meshes in this folder; csm reads {', '.join(READABLE)}"


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
    """Check files or a folder and print the table; DataError if something cannot be used for what is asked."""
    paths = [Path(path) for path in [*cfg.paths, *([cfg.folder] if cfg.folder else [])]]
    if not paths:
        raise ConfigError("check needs meshes: csm check FOLDER, or csm check a.off b.ply")
    if len(paths) == 1 and not os.path.lexists(paths[0]):
        raise DataError(f"{paths[0]}: there is no such file or folder")
    if cfg.use not in (None, "train", "match"):
        raise ConfigError(f"use={cfg.use}: wanted train, match or null")
    if len(paths) == 1 and paths[0].is_dir() and cfg.use != "match":
        try:
            report = check_folder(paths[0])
        except DataError as error:
            below = find_sets(paths[0])
            if cfg.use != "train" and below:
                return _list(below)
            if not below and not listed_meshes(paths[0]).files:
                print("\n".join(_known_sets()))
                said = str(error).partition("; wanted one of")[0]
                raise DataError(f"{said}; wanted meshes of your own, or one of the sets above") from None
            if cfg.use == "train":
                raise
            print(f"No data set ({error}), so each mesh is checked as one to match.\n")
            return check_files(paths)
        if cfg.use == "train" or _is_of_one_template(report.shapes):
            return _conclude(report, paths[0])
        print("The meshes differ in their triangles and there are no maps, so each is checked as one to match.\n")
    return check_files(paths)


def _list(sets: Sequence[FolderSet]) -> dict[str, Any]:
    """Print the sets below a folder, and how to check one of them."""
    for each in sets:
        gone = f", {counted(len(each.missing), 'file is', 'files are')} missing" if each.missing else ""
        print(f"{each.name}: {counted(len(each.names), 'shape')} ({each.layout.title}) in {each.root}{gone}")
    print(f"\n{counted(len(sets), 'set')}; csm check {sets[0].root} checks the meshes of one")
    return {"sets": len(sets)}


def _conclude(report: Report, folder: Path) -> dict[str, Any]:
    print("\n".join([str(report), *_left_out(folder)]))
    if report.n_unusable:
        raise DataError(
            f"{folder}: {report.n_unusable} of {counted(len(report.rows), 'shape')} cannot be used as a set with known "
            f"correspondence, see the table; csm check {folder} use=match checks meshes that are only to be matched"
        )
    return {"shapes": len(report.rows), "missing": len(report.shapes.missing)}


def _is_of_one_template(shapes: FolderSet) -> bool:
    """Tell whether a folder is meant as a set with correspondence: it has maps, or meshes of one connectivity."""
    if not any(isinstance(entry.truth, SameFaces) for entry in shapes.entries):
        return True
    known = sum(_has_truth(shapes, name) for name in shapes.names)
    return 2 * known > len(shapes.names)


def _has_truth(shapes: FolderSet, name: str) -> bool:
    try:
        shapes.load(name)
    except CsmError:
        return False
    return True


def check_files(paths: Sequence[Path]) -> dict[str, Any]:
    """Check meshes one by one, as `csm match` would take them; DataError if one cannot be used even after cleaning.

    A path without a mesh, and one that is not there, is a row of the table as well.
    """
    groups = [(path, listed_meshes(path).files if path.is_dir() else [path]) for path in paths]
    empty = [path for path, files in groups if not files]
    if len(paths) == len(empty) == 1:
        raise DataError(f"{empty[0]}: {_NO_MESHES}")
    rows = [_of_file(file) for _, files in groups for file in files]
    without = [Inspected(str(path), problems=(f"{path}: {_NO_MESHES}",)) for path in empty]
    print("\n".join(_table([*rows, *without])))
    n_gone = sum(not os.path.lexists(path) for path in paths)
    n_meshes, n_bad = len(rows) - n_gone, sum(bool(row.problems) for row in rows) - n_gone
    print(f"\n{counted(n_meshes, 'mesh')}, {n_meshes - n_bad} can be matched")
    print("".join(f"{line}\n" for path in paths for line in _left_out(path)), end="")
    said = [f"{n_bad} of {counted(n_meshes, 'mesh')} cannot be used"] if n_bad else []
    said += [f"{counted(n_gone, 'file or folder is', 'files or folders are')} not there"] if n_gone else []
    said += [f"{counted(len(empty), 'folder has', 'folders have')} no meshes"] if empty else []
    if said:
        raise DataError(f"{' and '.join(said)}, see the table")
    return {"shapes": len(rows), "missing": 0}


def _left_out(folder: Path) -> list[str]:
    """Say which meshes of a folder are not taken for shapes of it."""
    left_out = listed_meshes(folder).left_out if folder.is_dir() else ""
    return [f"{folder}: left out {left_out}"] if left_out else []


def _of_file(file: Path) -> Inspected:
    try:
        subject = subject_of(file)
        require_usable(subject.cleaned.mesh)
    except CsmError as error:
        return Inspected(file.name, problems=(str(error),))
    mesh, mends = subject.given, subject.cleaned.text
    notes = [Finding("note", 1, (), "note", note) for note in mesh.notes]
    notes += (
        [Finding("cleaned", len(subject.cleaned.mends), (), "note", f"csm match cleans it: {mends}")] if mends else []
    )
    return Inspected(file.name, mesh.n_vertices, mesh.n_faces, mesh.area, (*notes, *subject.findings))


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
    known = sum(row.n_truth is not None for row in rows)
    noted = sum(bool(row.findings) for row in rows if row.usable)
    lines = [
        f"{shapes.root}: {shapes.layout.title}, called {shapes.name}",
        f"{counted(len(rows), 'shape')}, {known} with correspondence; {report.n_unusable} cannot be used, "
        f"{noted} usable with notes",
    ]
    if shapes.pairs:
        lines.append(f"{counted(len(shapes.pairs), 'test pair')}, {len(shapes.mapped_pairs)} with both maps")
    lines += [f"list {name}: {counted(len(names), 'shape')}" for name, names in shapes.lists.items()]
    return lines


def _known_sets() -> list[str]:
    """Return what csm reads, and where the sets that it knows are published: a name, and below it the place."""
    lines = [
        f"csm reads meshes of your own ({', '.join(READABLE)}),",
        "and these sets, once you have fetched them:",
        "",
    ]
    for layout in layouts():
        if layout.key != "plain":
            wrapped = textwrap.wrap(layout.origin, 104, break_on_hyphens=False, break_long_words=False)
            lines += [f"  {layout.title}", *(f"      {line}" for line in wrapped)]
    return [*lines, ""]


def _what_is_missing(missing: Sequence[Missing]) -> list[str]:
    if not missing:
        return ["nothing is missing"]
    lines = [f"{counted(len(missing), 'file is', 'files are')} missing:"]
    for origin in dict.fromkeys(m.origin for m in missing):
        names = ", ".join(m.path for m in missing if m.origin == origin)
        lines += textwrap.wrap(names, 110, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)
        lines.append(f"  to be had from: {origin}")
    return lines


main = command("check")(run)
