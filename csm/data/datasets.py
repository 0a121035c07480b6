"""The data sets of the field as data modules; each names its folders, and the base class does the rest."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from csm.data.datamodule import CorrespondenceDataModule
from csm.data.folder import find_sets, recognise
from csm.data.folderset import FolderSet
from csm.data.humansset import HumansSet
from csm.data.splits import Split
from csm.data.store import Store
from csm.errors import DataError


def find_set(root: str | Path, *names: str) -> FolderSet:
    """Return the set called one of `names`, first come first, in a folder or below it.

    Raises
    ------
    DataError
        If there is none; the message lists the sets that are there.
    """
    found = {s.name: s for s in find_sets(Path(root))}
    for name in names:
        if name in found:
            return found[name]
    there = f"there are {', '.join(sorted(found))}" if found else "no published set was recognised there"
    raise DataError(
        f"{Path(root).resolve()}: wanted {' or '.join(names)}, but {there}; set data.root (or CSM_DATA) to the folder "
        "that holds it, `csm check FOLDER` tells what is in a folder and where a set is published"
    )


class HumansDataModule(CorrespondenceDataModule):
    """The built-in humans, which need no download; tests at other resolutions are made from them.

    Parameters
    ----------
    train
        Set to train on: "original", "refined_N" or "remeshed_N" for N vertices.
    test
        Sets to test on.
    options
        Of `CorrespondenceDataModule`.
    """

    def __init__(self, train: str = "original", test: Sequence[str] = ("original",), **options: Any) -> None:
        store: Store | None = options.get("store")
        root = None if store is None else str(store.root)
        super().__init__(HumansSet.parse(train, root), [HumansSet.parse(text, root) for text in test], **options)


class FaustDataModule(CorrespondenceDataModule):
    """FAUST registrations and, for tests at other resolutions, the remeshed ones of LPS-data.

    Parameters
    ----------
    root
        Folder with FAUST_6890 (the ACD release) or MPI-FAUST, and FAUST_8000 ... FAUST_15000 as far as used.
    train
        Resolution to train on.
    test
        Resolutions to test on.
    options
        Of `CorrespondenceDataModule`.
    """

    def __init__(
        self, root: str | Path, train: int = 6890, test: Sequence[int] = (6890, 10000, 15000), **options: Any
    ) -> None:
        sets = {n: self._set(root, n) for n in (train, *test)}
        super().__init__(sets[train], [sets[n] for n in test], **options)

    @staticmethod
    def _set(root: str | Path, n_vertices: int) -> FolderSet:
        names = ("FAUST_6890", "FAUST_MPI") if n_vertices == 6890 else (f"FAUST_{n_vertices}",)
        return find_set(root, *names)


class ScapeDataModule(CorrespondenceDataModule):
    """SCAPE, remeshed to about 5000 vertices; the 5000 classes reach a shape's vertices through its label file.

    Parameters
    ----------
    root
        Folder with SCAPE_5000.
    test_roots
        Folders of the same bodies in other triangulations, such as the 12,500 vertices that the paper tests on and that
        nobody publishes: files called as in SCAPE_5000 (mesh052.off), and within a folder one connectivity.  They are
        tested on besides SCAPE_5000.
    options
        Of `CorrespondenceDataModule`.
    """

    def __init__(self, root: str | Path, test_roots: Sequence[str | Path] | None = None, **options: Any) -> None:
        scape = find_set(root, "SCAPE_5000")
        super().__init__(scape, [scape, *map(recognise, test_roots or ())], **options)


class ToscaDataModule(CorrespondenceDataModule):
    """One class of remeshed TOSCA; correspondence is known within a class only.

    Parameters
    ----------
    root
        Folder with TOSCA_5k_remeshed.
    category
        "cat", "centaur", "david", "dog", "gorilla", "horse", "michael", "victoria" or "wolf".
    n_train
        The first so many shapes of the class train, the others test.
    options
        Of `CorrespondenceDataModule`.
    """

    def __init__(self, root: str | Path, category: str = "cat", n_train: int = 8, **options: Any) -> None:
        tosca = find_set(root, "TOSCA_5k_remeshed")
        names = [entry.name for entry in tosca.entries if entry.template == category]
        if len(names) <= n_train:
            known = ", ".join(sorted({entry.template for entry in tosca.entries}))
            raise DataError(
                f"{tosca.root}: class {category!r} has {len(names)} shapes, too few to train on {n_train} and test on "
                f"the rest; the classes are {known}"
            )
        options.setdefault("split", Split(f"tosca_{category}", tuple(names[:n_train]), tuple(names[n_train:])))
        super().__init__(tosca, [tosca], **options)


class Shrec19DataModule(CorrespondenceDataModule):
    """The mapped shapes of SHREC'19 over the FAUST template, so that a network trained on FAUST can be tested on them.

    Parameters
    ----------
    root
        Folder with SHREC19_5k_remeshed.
    n_train
        The first so many mapped shapes train, the others test.
    options
        Of `CorrespondenceDataModule`.
    """

    def __init__(self, root: str | Path, n_train: int = 10, **options: Any) -> None:
        shrec = find_set(root, "SHREC19_5k_remeshed")
        options.setdefault("split", Split("shrec19", shrec.mapped[:n_train], shrec.mapped[n_train:]))
        super().__init__(shrec, [shrec], **options)


class FolderDataModule(CorrespondenceDataModule):
    """Any folder that `csm check` recognises, such as your own meshes with one connectivity or with .vts maps.

    Parameters
    ----------
    root
        Folder of the training meshes.
    test_roots
        Folders to test on, over the same template; by default the training folder.
    split
        A split file. Without one, the last `n_test` shapes of the training folder are the test shapes.
    n_test
        See `split`.
    options
        Of `CorrespondenceDataModule`.
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
        if split is None:
            n_test = n_test if n_test is not None else max(1, len(train.mapped) // 5)
            split = Split(train.name, train.mapped[:-n_test], train.mapped[-n_test:])
        tests = [recognise(folder) for folder in test_roots] if test_roots else [train]
        super().__init__(train, tests, split=split, **options)
