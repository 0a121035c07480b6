"""Unpack a published data set: recognise it, copy it to a folder where csm finds it, and check it."""

from __future__ import annotations

import argparse
import filecmp
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from csm._counts import counted
from csm._locks import locked
from csm._signals import exit_status, terminable
from csm.data.folders import FolderSet, Layout
from csm.data.inspection import Inspected, inspect
from csm.data.prepare import Job, Recipe, Summary, prepare
from csm.data.registry import find_sets, recognise
from csm.data.store import Store
from csm.descriptors.acd import ACD
from csm.errors import CsmError, DataError
from csm.mesh.io import copy_file, unpacked


@dataclass(frozen=True, eq=False)
class Unpacked:
    """A set in its new folder, with what was found about each shape."""

    shapes: FolderSet
    rows: tuple[Inspected, ...]

    def __str__(self) -> str:
        bad = [f"  {row.name}: {why}" for row in self.rows if not row.usable for why in _why(row)]
        noted = sum(bool(row.findings) for row in self.rows if row.usable)
        n_missing = len(self.shapes.missing)
        head = (
            f"{self.shapes.root}: {self.shapes.layout.title}, {counted(len(self.rows), 'shape')}, "
            f"{len(self.shapes.mapped)} with correspondence, {noted} with notes, "
            f"{len(self.rows) - sum(r.usable for r in self.rows)} unusable, "
            f"{counted(n_missing, 'file')} missing" + (" (csm check lists them)" if n_missing else "")
        )
        return "\n".join([head, *bad])


def unpack(
    source: Path, out: Path, layouts: Sequence[Layout], progress: bool = True, *, overwrite: bool = False
) -> list[Unpacked]:
    """Copy every set in one of the wanted layouts from an archive or folder to `out/NAME`, and check the copy.

    Parameters
    ----------
    source
        Archive (.zip, .tar, .tar.xz, ...) or folder as published; it is only read.
    out
        Folder that gets one folder per set.
    layouts
        The wanted layouts.
    progress
        Show a progress bar with the shape's name.
    overwrite
        Replace files in `out/NAME` that differ, such as those that were edited after an earlier run.

    Raises
    ------
    DataError
        If the source holds no set in these layouts or cannot be unpacked, `out/NAME` is the source itself, or files
        there differ from the source's.
    """
    with _content(source) as folder:
        found = [shapes for shapes in find_sets(folder) if shapes.layout in layouts]
        if not found:
            raise DataError(f"{source}: holds no {_any_of(layouts)}. Where to get it: {_origins(layouts)}")
        placed = [lay_out(shapes, out / shapes.name, overwrite=overwrite) for shapes in found]
    return [Unpacked(shapes, inspect(shapes, progress)) for shapes in placed]


@contextmanager
def _content(source: Path) -> Iterator[Path]:
    """Give the folder that a source is unpacked to; whatever is wrong with an archive is a DataError that names it."""
    with ExitStack() as stack:
        try:
            folder = stack.enter_context(unpacked(source))
        except CsmError:
            raise
        except Exception as error:  # unpackers raise what they like at a damaged, encrypted or oddly packed member
            raise DataError(f"{source}: cannot be unpacked ({error}); wanted a whole .zip or .tar archive") from error
        yield folder


def lay_out(shapes: FolderSet, target: Path, *, overwrite: bool = False) -> FolderSet:
    """Copy the files of a set to a folder, in the same layout, and return the set that is recognised there.

    Files that are there already and are the same are left alone.  Processes that lay out in one folder take turns.

    Parameters
    ----------
    shapes
        The set as published.
    target
        The folder.
    overwrite
        Replace files that are there and differ.

    Raises
    ------
    DataError
        If `target` lies in the set's own folder, the set has no shapes, or files that are there differ.
    """
    if target.resolve().is_relative_to(shapes.root.resolve()):
        raise DataError(
            f"{target}: lies in the source folder {shapes.root}, which is not changed; choose another place"
        )
    if not shapes.entries:
        raise DataError(f"{shapes.root}: this {shapes.layout.title} folder has no shapes; {shapes.layout.origin}")
    target.parent.mkdir(parents=True, exist_ok=True)
    with locked(target.parent, wait=600):
        pairs = [(path, target / path.relative_to(shapes.root)) for path in shapes.files]
        changes = [(path, new) for path, new in pairs if not _same(path, new)]
        differ = [new for _, new in changes if os.path.lexists(new)]
        if differ and not overwrite:
            raise DataError(_refusal(shapes, target, differ))
        for path, new in changes:
            copy_file(path, new)
    return recognise(target)


def _same(a: Path, b: Path) -> bool:
    return b.is_file() and filecmp.cmp(a, b, shallow=False)


def _refusal(shapes: FolderSet, target: Path, differ: Sequence[Path]) -> str:
    shown = ", ".join(str(path.relative_to(target)) for path in differ[:5]) + (", ..." if len(differ) > 5 else "")
    return (
        f"{target}: {len(differ)} of {len(shapes.files)} files are there already and differ from the source's "
        f"({shown}); nothing was written; --overwrite replaces them, or choose another --out"
    )


def fill_store(shapes: FolderSet, store: Store) -> Summary:
    """Compute what the paper's network needs, ACD and the eigenbasis, for all shapes with correspondence.

    Commands that use other descriptors compute them when they run; the store keeps both.
    """
    return prepare([Job(shapes, name) for name in shapes.mapped], [Recipe(ACD.paper())], store)


def script(title: str, layouts: Sequence[Layout], argv: Sequence[str] | None = None) -> int:
    """Run a script of `data_prep/`: parse the arguments, unpack the sets, report.

    Parameters
    ----------
    title
        First line of the help.
    layouts
        The layouts that the script unpacks.
    argv
        Arguments; by default the process's.

    Returns
    -------
    int
        Exit status: 0, 1 if some shape cannot be used or prepared, 2 after an error that the user can mend, 130 or 143
        if it was stopped.
    """
    parser = argparse.ArgumentParser(
        description=title,
        epilog="csm downloads nothing. Where to get it: " + _origins(layouts),
    )
    parser.add_argument("source", nargs="+", type=Path, help="archives (.zip, .tar.xz, ...) or folders as published")
    parser.add_argument("--out", type=Path, required=True, help="folder that gets one folder per set")
    parser.add_argument("--store", action="store_true", help="also compute the paper's descriptors and bases")
    parser.add_argument("--overwrite", action="store_true", help="replace files in --out that differ from the source's")
    options = parser.parse_args(argv)
    try:
        with terminable():
            return _run(options, layouts)
    except CsmError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{parser.prog}: {error.filename or options.out}: {error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as stop:
        print(f"{parser.prog}: stopped: {str(stop) or 'run the same command again to go on'}", file=sys.stderr)
        return exit_status(stop)


def _run(options: argparse.Namespace, layouts: Sequence[Layout]) -> int:
    unpacked_sets = [
        found
        for source in options.source
        for found in unpack(source, options.out, layouts, overwrite=options.overwrite)
    ]
    for found in unpacked_sets:
        print(found)
    filled = [fill_store(found.shapes, Store()) for found in unpacked_sets if options.store]
    for summary in filled:
        print(f"{summary.made} prepared, {summary.present} already in the store, {len(summary.failures)} failed")
        print(summary.table(), end="\n" if summary.failures else "")
    good = all(row.usable for found in unpacked_sets for row in found.rows) and not any(s.failures for s in filled)
    return 0 if good else 1


def _why(row: Inspected) -> list[str]:
    return [*row.problems, *(finding.text for finding in row.findings if finding.severity == "error")]


def _any_of(layouts: Sequence[Layout]) -> str:
    return " or ".join(layout.title for layout in layouts) + " set"


def _origins(layouts: Sequence[Layout]) -> str:
    return "; ".join(f"{layout.title}: {layout.origin}" for layout in layouts)
