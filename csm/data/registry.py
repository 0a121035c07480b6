"""The data sets by name, and finding them in folders.

A new data set is one file with a `DATA_SET` (see `csm.data.base.DataSet`) and one line in `DATA_SETS`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from csm._places import load
from csm.errors import ConfigError, DataError
from csm.mesh.io import list_folders

if TYPE_CHECKING:
    from csm.data.base import DataSet
    from csm.data.folders import FolderSet, Layout

DATA_SETS = {
    "humans": "csm.data.humans",
    "faust": "csm.data.faust",
    "scape": "csm.data.scape",
    "tosca": "csm.data.tosca",
    "shrec19": "csm.data.shrec19",
    "folder": "csm.data.folder",
}
"""Name of the data set in options -> its module.  A folder is compared with their layouts in this order."""


def data_set(name: str) -> DataSet:
    """Return the declaration of a data set: its data module, layouts and splits.

    Raises
    ------
    DataError
        If there is no such data set.
    """
    if name not in DATA_SETS:
        raise DataError(f"there is no data set {name!r}; there are {', '.join(DATA_SETS)}")
    found: DataSet = load(f"{DATA_SETS[name]}:DATA_SET")
    return found


@cache
def layouts() -> tuple[Layout, ...]:
    """Return all layouts that csm knows, that of plain folders last."""
    return tuple(layout for name in DATA_SETS for layout in data_set(name).layouts)


def recognise(folder: str | Path) -> FolderSet:
    """Return the set in a folder, of whichever layout; only names, lists and one mesh header are read.

    Raises
    ------
    DataError
        If there are no meshes; the message names sub-folders that would be recognised, or the known layouts.
    """
    if not isinstance(folder, str | os.PathLike):
        raise ConfigError(f"a set is recognised in a folder given by its path, got a {type(folder).__name__}")
    root = Path(folder)
    if not root.is_dir():
        raise DataError(f"{root}: there is no such folder")
    found = _first(root, layouts())
    if found:
        return found
    below = [str(s.root) for s in find_sets(root, depth=2)]
    if below:
        raise DataError(f"{root}: this is no set itself; did you mean {', '.join(below[:10])}?")
    known = "; ".join(layout.title for layout in layouts())
    plain = [str(path) for path in list_folders(root, 2) if _first(path, layouts())]
    where = f"; there are some in {', '.join(plain[:10])}" if plain else ""
    raise DataError(f"{root}: there are no meshes that csm can read{where}; wanted one of: {known}")


def find_sets(folder: Path, depth: int = 4) -> list[FolderSet]:
    """Return the published sets in a folder and below it, as an unpacked archive or repository holds them.

    A folder inside a recognised one is not looked at again, and plain folders do not count.
    """
    published = [layout for layout in layouts() if layout.key != "plain"]
    found: list[FolderSet] = []
    for path in [folder, *list_folders(folder, depth)]:
        if not any(path.is_relative_to(s.root) for s in found):
            match = _first(path, published)
            found += [match] if match else []
    return found


def find_set(root: str | Path | None, *names: str) -> FolderSet:
    """Return the set with the first of these names that occurs in a folder or below it.

    Parameters
    ----------
    root
        The folder; None for the environment variable `CSM_DATA`, else the folder `data`.
    names
        What results call the set, such as "FAUST_6890"; the preferred name first.

    Raises
    ------
    DataError
        If there is none; the message lists the sets that were found.
    """
    place = Path(root if root is not None else os.environ.get("CSM_DATA", "data"))
    found = {s.name: s for s in find_sets(place)}
    for name in names:
        if name in found:
            return found[name]
    there = f"there are {', '.join(sorted(found))}" if found else f"no published set was recognised {_among(place)}"
    raise DataError(
        f"{place.resolve()}: wanted {' or '.join(names)}, but {there}; set data.root (or CSM_DATA) to the folder "
        "that holds it; `csm check FOLDER` tells what is in a folder and where a set is published"
    )


def _among(place: Path) -> str:
    """Return where nothing was recognised: the first folders of a place by name, or "there"."""
    folders = sorted(each.name for each in place.iterdir() if each.is_dir()) if place.is_dir() else []
    return f"in its folders {', '.join(folders[:5])}{', ...' if len(folders) > 5 else ''}" if folders else "there"


def _first(folder: Path, known: Sequence[Layout]) -> FolderSet | None:
    return next((found for layout in known if (found := layout(folder))), None)
