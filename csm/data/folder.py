"""Any folder of meshes: one connectivity for all shapes, or maps from a template in `corres/NAME.vts`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from csm._counts import counted
from csm.data.base import DataModule, DataSet
from csm.data.folders import PAIRS, Entry, FolderSet, Layout, Missing, SameFaces, absent, listed_pairs, stems
from csm.data.registry import recognise
from csm.data.splits import Split, as_split
from csm.errors import DataError
from csm.mesh.io import list_files
from csm.mesh.io.listing import ARRAYS, GEOMETRY, written_meshes


def _plain(layout: Layout, folder: Path) -> FolderSet | None:
    """Find meshes in the folder or in its `off`, with `corres/NAME.vts`, or else one connectivity for all.

    What a match has written into the folder is no shape of it.
    """
    places, written = [(folder, GEOMETRY), (folder / "off", GEOMETRY), (folder, ARRAYS)], written_meshes(folder)
    found = ([path for path in list_files(place, *suffixes) if path.name not in written] for place, suffixes in places)
    meshes = next((files for files in found if files), [])
    if not meshes:
        return None
    by_name, maps = stems(meshes), stems(list_files(folder / "corres", ".vts"))
    entries = tuple(
        Entry(name, path, maps.get(name) if maps else SameFaces(), maps.get(f"{name}.sym"))
        for name, path in by_name.items()
    )
    pairs, extras = listed_pairs(folder)
    named = dict.fromkeys(name for pair in pairs for name in pair)
    missing = tuple(Missing(name, f"named in {PAIRS}") for name in named if name not in by_name)
    missing += absent(by_name, maps, Path("corres"), ".vts", layout.origin) if maps else ()
    return FolderSet(folder.resolve().name, layout, folder, entries, pairs, missing=missing, extras=extras)


PLAIN = Layout("plain", "plain folder", "your own files", _plain)


class FolderDataModule(DataModule):
    """Any folder that `csm check` recognises, such as your own meshes with one connectivity or with .vts maps.

    Parameters
    ----------
    root
        Folder of the training meshes.
    test_roots
        Folders to test on, over the same template; by default the training folder.
    split
        A split, or the path of a split file.  Without one, the last `n_test` shapes of the training folder are the test
        shapes.
    n_test
        See `split`; by default a fifth of the shapes, and at least two where that leaves one to train on, because a
        test is of pairs.
    options
        Of `csm.data.base.DataModule`.

    Raises
    ------
    DataError
        If `n_test` leaves no shape to train on or none to test on.
    """

    def __init__(
        self,
        root: str | Path,
        test_roots: Sequence[str | Path] | None = None,
        split: str | Path | Split | None = None,
        n_test: int | None = None,
        **options: Any,
    ) -> None:
        train = recognise(root)
        tests = [recognise(folder) for folder in test_roots] if test_roots else [train]
        super().__init__(train, tests, _last(train, n_test) if split is None else as_split(split), **options)


def _last(train: FolderSet, n_test: int | None) -> Split:
    """Return the split whose test shapes are the last `n_test` shapes with a map."""
    names = train.mapped
    count = max(2 if len(names) > 2 else 1, len(names) // 5) if n_test is None else n_test
    if not 0 < count < len(names):
        raise DataError(
            f"{train.root}: {counted(len(names), 'shape')} with known correspondence cannot be divided into training "
            f"shapes and {counted(count, 'test shape')}; wanted at least one of each (see n_test), or a split"
        )
    return Split(train.name, names[:-count], names[-count:])


DATA_SET = DataSet(FolderDataModule, (PLAIN,))
