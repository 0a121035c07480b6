"""SCAPE: 71 poses of one person, remeshed to about 5000 vertices, each with another connectivity.

`shapes/mesh000.mat` to `mesh071.mat` (there never was a mesh051), `labels/NAME.mat` with the vertex of each of the 5000
classes, and the lists `files_train.txt` and `files_test.txt`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from csm.data.base import DataModule, DataSet
from csm.data.folders import Entry, FolderSet, Layout, absent, absent_files, exists, stems
from csm.data.registry import find_set, recognise
from csm.data.splits import Split, as_split
from csm.mesh.io import list_files, read_names

NAMES = tuple(f"mesh{i:03d}" for i in range(72) if i != 51)
SPLIT = Split(
    "scape_51_20",
    NAMES[:51],
    NAMES[51:],
    "files_train.txt and files_test.txt of the paper's released code; mesh051 does not exist",
)


def _released(layout: Layout, folder: Path) -> FolderSet | None:
    meshes = stems(list_files(folder / "shapes", ".mat"))
    if not meshes or not set(meshes) <= set(NAMES):
        return None
    labels = stems(list_files(folder / "labels", ".mat"))
    missing = absent(NAMES, meshes, Path("shapes"), ".mat", layout.origin)
    missing += absent(NAMES, labels, Path("labels"), ".mat", layout.origin)
    files = {part: folder / f"files_{part}.txt" for part in ("train", "test")}
    missing += absent_files(files.values(), folder, layout.origin)
    present = {part: path for part, path in files.items() if exists(path)}
    lists = {part: tuple(read_names(path)) for part, path in present.items()}
    entries = tuple(Entry(name, path, labels.get(name)) for name, path in meshes.items())
    return FolderSet(
        "SCAPE_5000", layout, folder, entries, lists=lists, missing=missing, extras=tuple(present.values())
    )


RELEASE = Layout(
    "acd_scape",
    "ACD release, SCAPE",
    "https://github.com/Wang-Chen9/Anisotropic-Chebyshev-Descriptor, CSMCNN/datasets/SCAPE (research only)",
    _released,
)


class ScapeDataModule(DataModule):
    """SCAPE, remeshed to about 5000 vertices; the 5000 classes reach a shape's vertices through its label file.

    Parameters
    ----------
    root
        Folder with SCAPE_5000; None for the environment variable `CSM_DATA`, else the folder `data`.
    test_roots
        Folders of the same bodies in other triangulations, such as the 12,500 vertices that the paper tests on and that
        nobody publishes: files called as in SCAPE_5000 (mesh052.off), and within a folder one connectivity.  They are
        tested on besides SCAPE_5000.
    split
        A split, its name, or the path of a split file.
    options
        Of `csm.data.base.DataModule`.
    """

    def __init__(
        self,
        root: str | Path | None = None,
        test_roots: Sequence[str | Path] | None = None,
        split: str | Path | Split = SPLIT.name,
        **options: Any,
    ) -> None:
        scape = find_set(root, "SCAPE_5000")
        super().__init__(scape, [scape, *map(recognise, test_roots or ())], as_split(split, [SPLIT]), **options)


DATA_SET = DataSet(ScapeDataModule, (RELEASE,), (SPLIT,))
