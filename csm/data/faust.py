"""FAUST: 100 registered scans of 10 persons in 10 poses, in the four forms in which people have it.

| folder | vertices | correspondence | published by |
|---|---|---|---|
| FAUST_MPI | 6890 | the same connectivity | MPI-FAUST, after registration |
| FAUST_6890 | 6890 | label files (the identity) | the release of the ACD paper |
| FAUST_8000 ... FAUST_15000 | 8000 to 15,000 | the first 6890 vertices | LPS-data |
| FAUST_5k_remeshed | about 5000, each another connectivity | `.vts` and mirrored `.sym.vts` maps | SGA18/BCICP |
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from csm.data.base import DataModule, DataSet
from csm.data.folders import Entry, FirstVertices, FolderSet, Layout, absent, remeshed_set, stems
from csm.data.registry import find_set
from csm.data.splits import Split, as_split
from csm.errors import MeshError
from csm.mesh.io import count_vertices, list_files

N_VERTICES = 6890
"""Vertices of the registrations, which are the SMPL template's."""

NAMES = tuple(f"tr_reg_{i:03d}" for i in range(100))
REFINED = (8000, 10000, 12000, 15000)
"""Vertices of the resolutions of LPS-data."""

REMESHED = 5000
"""About as many vertices have the bodies with other triangles."""

SPLIT = Split(
    "faust_80_20", NAMES[:80], NAMES[80:], "The paper, section 5: the first 80 registrations train, the last 20 test"
)

HELD_OUT = Split(
    "faust_held_out", NAMES[:60], NAMES[60:80], "csm: persons 6 and 7 of the training shapes, to choose settings on"
)


def _registrations(layout: Layout, folder: Path) -> FolderSet | None:
    """Find `training/registrations/tr_reg_000.ply` to `099.ply`, from any folder above or from `registrations`."""
    inner = Path("training/registrations")
    for place in (folder / "MPI-FAUST" / inner, folder / inner, folder / "registrations", folder):
        meshes = stems(list_files(place, ".ply"))
        if meshes and set(meshes) <= set(NAMES):
            break
    else:
        if not list_files(folder / "training/scans", ".ply"):
            return None
        place, meshes = folder / inner, {}  # only the scans were unpacked: a known set without any registration
    entries = tuple(Entry(name, path, FirstVertices(N_VERTICES)) for name, path in meshes.items())
    missing = absent(NAMES, meshes, place.relative_to(folder), ".ply", layout.origin)
    return FolderSet("FAUST_MPI", layout, folder, entries, missing=missing)


def _released(layout: Layout, folder: Path) -> FolderSet | None:
    """Find `shapes/tr_reg_000.mat` with `labels/tr_reg_000.mat`."""
    meshes = stems(list_files(folder / "shapes", ".mat"))
    if not meshes or not set(meshes) <= set(NAMES):
        return None
    labels = stems(list_files(folder / "labels", ".mat"))
    missing = absent(NAMES, meshes, Path("shapes"), ".mat", layout.origin)
    missing += absent(NAMES, labels, Path("labels"), ".mat", layout.origin)
    entries = tuple(Entry(name, path, labels.get(name)) for name, path in meshes.items())
    return FolderSet("FAUST_6890", layout, folder, entries, missing=missing)


def _remeshed(layout: Layout, folder: Path) -> FolderSet | None:
    found = remeshed_set(layout, folder, "FAUST_5k_remeshed", lambda _: "", NAMES)
    return found if found and {entry.name for entry in found.entries} <= set(NAMES) else None


def _refined(layout: Layout, folder: Path) -> FolderSet | None:
    """Find `tr_reg_000.off` to `099.off` with as many vertices as LPS-data, the first 6890 of them FAUST's."""
    meshes = stems(list_files(folder, ".off"))
    if not meshes or not set(meshes) <= set(NAMES) or list_files(folder / "corres", ".vts"):
        return None
    try:
        n = count_vertices(next(iter(meshes.values())))
    except MeshError:
        return None  # the reader of plain folders will say what is wrong with the file
    if n not in REFINED:
        return None
    entries = tuple(Entry(name, path, FirstVertices(N_VERTICES)) for name, path in meshes.items())
    return FolderSet(
        f"FAUST_{n}", layout, folder, entries, missing=absent(NAMES, meshes, Path(), ".off", layout.origin)
    )


MPI = Layout(
    "mpi_faust",
    "MPI-FAUST",
    "MPI-FAUST.zip from http://faust.is.tue.mpg.de (registration with the Max Planck Institute is needed; "
    "non-commercial research, no redistribution)",
    _registrations,
)
RELEASE = Layout(
    "acd_faust",
    "ACD release, FAUST",
    "https://github.com/Wang-Chen9/Anisotropic-Chebyshev-Descriptor, CSMCNN/datasets/FAUST (MPI-FAUST terms)",
    _released,
)
LPS = Layout(
    "lps",
    "LPS-data",
    "https://github.com/yiqun-wang/LPS-data, faust_all_8000 to faust_all_15000 (MPI-FAUST terms)",
    _refined,
)
SGA18 = Layout(
    "sga18_faust",
    "SGA18/BCICP remeshed FAUST",
    "https://github.com/llorz/SGA18_orientation_BCICP_dataset, Dataset/FAUST (MPI-FAUST terms)",
    _remeshed,
)


class FaustDataModule(DataModule):
    """FAUST registrations and, for tests at other resolutions, the refined ones of LPS-data.

    Parameters
    ----------
    root
        Folder with FAUST_6890 (the ACD release) or MPI-FAUST, and those of FAUST_8000 ... FAUST_15000 and
        FAUST_5k_remeshed that are used; None for the environment variable `CSM_DATA`, else the folder `data`.
    train
        Resolution to train on.
    test
        Resolutions to test on; 5000 are the bodies with other triangles throughout (SGA18/BCICP).
    split
        A split, its name, or the path of a split file.
    options
        Of `csm.data.base.DataModule`.
    """

    def __init__(
        self,
        root: str | Path | None = None,
        train: int = 6890,
        test: Sequence[int] = (6890, 10000, 15000),
        split: str | Path | Split = SPLIT.name,
        **options: Any,
    ) -> None:
        sets = {n: find_set(root, *names_of(n)) for n in (train, *test)}
        super().__init__(sets[train], [sets[n] for n in test], as_split(split, [SPLIT, HELD_OUT]), **options)


def names_of(n_vertices: int) -> tuple[str, ...]:
    """Return what the sets of one resolution are called, the preferred one first.

    Examples
    --------
    >>> names_of(6890), names_of(10000)
    (('FAUST_6890', 'FAUST_MPI'), ('FAUST_10000',))
    """
    others = {N_VERTICES: ("FAUST_6890", "FAUST_MPI"), REMESHED: ("FAUST_5k_remeshed",)}
    return others.get(n_vertices, (f"FAUST_{n_vertices}",))


DATA_SET = DataSet(FaustDataModule, (MPI, RELEASE, SGA18, LPS), (SPLIT, HELD_OUT))
