"""SHREC'19: 44 human bodies of many makers, remeshed to about 5000 vertices, with maps onto the FAUST template.

`1.obj` to `44.obj`, `test_pairs.txt`, and the maps in `derived_smpl_vts/NAME.vts` or `corres/NAME.vts`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from csm.data.base import DataModule, DataSet
from csm.data.folders import PAIRS, Entry, FolderSet, Layout, absent, absent_files, listed_pairs, stems
from csm.data.registry import find_set
from csm.data.splits import Split, as_split
from csm.mesh.io import list_files

NAMES = tuple(str(i) for i in range(1, 45))


def _remeshed(layout: Layout, folder: Path) -> FolderSet | None:
    meshes = stems(list_files(folder, ".obj") or list_files(folder, ".off"))
    pairs, extras = listed_pairs(folder)
    if not meshes or not set(meshes) <= set(NAMES) or not (pairs or len(meshes) == len(NAMES)):
        return None
    place = next((p for p in ("derived_smpl_vts", "corres") if list_files(folder / p, ".vts")), "corres")
    maps = stems(list_files(folder / place, ".vts"))
    entries = tuple(Entry(name, path, maps.get(name)) for name, path in meshes.items())
    missing = absent(NAMES, meshes, Path(), ".obj", layout.origin)
    missing += absent(NAMES, maps, Path(place), ".vts", layout.origin)
    missing += absent_files([folder / PAIRS], folder, layout.origin)
    return FolderSet("SHREC19_5k_remeshed", layout, folder, entries, pairs, missing=missing, extras=extras)


REMESHED = Layout(
    "shrec19",
    "SHREC'19 remeshed",
    "https://github.com/llorz/SGA20_mapExplor (meshes), https://github.com/riccardomarin/SHREC19_matching_humans "
    "(original meshes and maps; CC BY-NC 4.0)",
    _remeshed,
)


class Shrec19DataModule(DataModule):
    """The mapped shapes of SHREC'19 over the FAUST template, so that a network trained on FAUST can be tested on them.

    Parameters
    ----------
    root
        Folder with SHREC19_5k_remeshed; None for the environment variable `CSM_DATA`, else the folder `data`.
    n_train
        Number of training shapes, the first ones with a map; the others are the test shapes.
    split
        A split, or the path of a split file, instead of `n_train`.
    options
        Of `csm.data.base.DataModule`.
    """

    def __init__(
        self,
        root: str | Path | None = None,
        n_train: int = 10,
        split: str | Path | Split | None = None,
        **options: Any,
    ) -> None:
        shrec = find_set(root, "SHREC19_5k_remeshed")
        default = Split("shrec19", shrec.mapped[:n_train], shrec.mapped[n_train:])
        super().__init__(shrec, [shrec], default if split is None else as_split(split), **options)


DATA_SET = DataSet(Shrec19DataModule, (REMESHED,))
