"""A small set of deformed shapes with one connectivity, for tests that need a whole data module."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from csm.data.folder import FolderDataModule
from csm.data.store import Store
from csm.descriptors import ACD
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from tests.shapes import blob


def write_toys(folder: Path, n: int = 6, subdivisions: int = 2) -> Path:
    """Write n smooth deformations of one blob (162 or 642 vertices) as off files; vertex i is the same point in all."""
    base = blob(subdivisions)
    rng = np.random.default_rng(0)
    for i in range(n):
        x = base.vertices
        bend = 0.04 * np.sin(x @ rng.normal(size=(3, 3)) + rng.uniform(0, 6, 3))
        write_mesh(folder / f"toy{i}.off", Mesh(x + bend, base.faces, f"toy{i}"))
    return folder


def toy_datamodule(folder: Path, **options: object) -> FolderDataModule:
    """Return a data module over `write_toys(folder)`: four shapes train, two test."""
    write_toys(folder / "toys")
    settings: dict[str, object] = {
        "descriptor": ACD(angles=4, k=8, order=3, cuts=1),
        "basis_k": 24,
        "n_test": 2,
        "store": Store(folder / "store"),
        "workers": 0,
    }
    return FolderDataModule(folder / "toys", **(settings | options))  # type: ignore[arg-type]
