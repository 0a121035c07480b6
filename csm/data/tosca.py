"""TOSCA: 76 shapes of animals and people in eight classes, remeshed to about 5000 vertices (SGA18/BCICP).

`vtx_5k/NAME.off`, `vtx_5k/corres/NAME.vts` and the mirrored `NAME.sym.vts`, `test_pairs.txt`; correspondence is known
within a class (cat, centaur, david, dog, horse, michael, victoria, wolf).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from csm._counts import counted
from csm.data.base import DataModule, DataSet
from csm.data.folders import FolderSet, Layout, remeshed_set
from csm.data.registry import find_set
from csm.data.splits import Split, as_split
from csm.errors import DataError


def _remeshed(layout: Layout, folder: Path) -> FolderSet | None:
    return remeshed_set(layout, folder, "TOSCA_5k_remeshed", lambda stem: stem.rstrip("0123456789"))


SGA18 = Layout(
    "sga18_tosca",
    "SGA18/BCICP remeshed TOSCA",
    "https://github.com/llorz/SGA18_orientation_BCICP_dataset, Dataset/TOSCA_Isometric (academic use)",
    _remeshed,
)


class ToscaDataModule(DataModule):
    """One class of remeshed TOSCA; correspondence is known within a class only.

    Parameters
    ----------
    root
        Folder with TOSCA_5k_remeshed; None for the environment variable `CSM_DATA`, else the folder `data`.
    category
        "cat", "centaur", "david", "dog", "horse", "michael", "victoria" or "wolf".
    n_train
        Number of training shapes, the first ones of the class; the others are the test shapes.
    split
        A split, or the path of a split file, instead of `n_train`.
    options
        Of `csm.data.base.DataModule`.
    """

    def __init__(
        self,
        root: str | Path | None = None,
        category: str = "cat",
        n_train: int = 8,
        split: str | Path | Split | None = None,
        **options: Any,
    ) -> None:
        tosca = find_set(root, "TOSCA_5k_remeshed")
        names = [entry.name for entry in tosca.entries if entry.template == category]
        if len(names) <= n_train:
            known = ", ".join(sorted({entry.template for entry in tosca.entries}))
            raise DataError(
                f"{tosca.root}: class {category!r} has {counted(len(names), 'shape')}, too few to train on {n_train} "
                f"and test on the rest; the classes are {known}"
            )
        default = Split(f"tosca_{category}", tuple(names[:n_train]), tuple(names[n_train:]))
        super().__init__(tosca, [tosca], default if split is None else as_split(split), **options)


DATA_SET = DataSet(ToscaDataModule, (SGA18,))
