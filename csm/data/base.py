"""The base class of the data modules, and the declaration that every file of a data set ends with.

Nothing here needs PyTorch or Lightning; `csm.learning.loading` turns a data module into what Lightning's trainer takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from csm._counts import counted
from csm._parallel import n_processes
from csm.data.additional import additional
from csm.data.folders import FolderSet, Layout
from csm.data.prepare import Job, Prepared, Recipe, is_prepared, prepare, prepare_mesh
from csm.data.shapes import InMemory, Shape, ShapeSet
from csm.data.splits import Split
from csm.data.store import Store
from csm.data.variants import in_form
from csm.descriptors.base import Descriptor
from csm.errors import CsmError, DataError
from csm.operators.stencils import Stencil


class DataModule:
    """Base class of the data modules: a training set, any number of test sets over the same template, one split.

    Parameters
    ----------
    train_set
        Set that the training and validation shapes come from.
    test_sets
        Sets to test on; results call each by its name, see `distinct`.
    split
        Which shapes train and which test.
    descriptor
        Gives the input features.
    basis_k
        Eigenpairs kept per shape; a network may use fewer.
    holdout
        How many shapes, the last of the training list, are held out of the fit to validate on.  With 0 these are the
        validation shapes of the split.  Where it names none, the last ten training shapes are looked at although they
        are fitted: their error says little more than that the training runs, and is called so (`validates_unseen`).
    store
        Where features and bases are kept.
    workers
        Processes for the preparation and for the distances of tests, see `csm._parallel.n_processes`.
    stencils
        What else the network needs of a shape, see `csm.operators.stencils`.
    also
        Names of additional training shapes, see `csm.data.additional`: "remeshed_5000" are the fitted shapes with other
        triangles, "humans" the built-in ones, which have a template, and in training a classifier, of their own.
    test_forms
        Forms of the first test set, see `csm.data.variants`, to test on as well: "refined_12500", "remeshed_5000",
        "uneven_8000", "slivers_30", "cut_30" and so on.

    Raises
    ------
    DataError
        If a set is there twice among the test sets, or no training shape is left to fit.
    ConfigError
        If `workers` is no number of processes, or there are no additional shapes of such a name.
    """

    def __init__(
        self,
        train_set: ShapeSet,
        test_sets: Sequence[ShapeSet],
        split: Split,
        *,
        descriptor: Descriptor,
        basis_k: int = 128,
        holdout: int = 0,
        store: Store | None = None,
        workers: int | None = None,
        stencils: Sequence[Stencil] = (),
        also: Sequence[str] = (),
        test_forms: Sequence[str] = (),
    ) -> None:
        n_processes(workers, 0)  # what is no number is refused before anything is read
        self.train_set, *tests = distinct([train_set, *test_sets])
        self.split, self.holdout, self.workers = split, holdout, workers
        self.recipe = Recipe(descriptor, basis_k, tuple(stencils))
        self.store = store or Store()
        tests += [in_form(tests[0], form, self.store, "data.test_forms") for form in test_forms]
        self.test_sets: Mapping[str, ShapeSet] = _by_name(tests)
        self.fit_names, held_out = split.held_out(holdout)
        self.validation_names = held_out or split.validation or split.train[-10:]
        self.also = tuple(additional(text, self.train_set, self.fit_names, self.store) for text in also)
        self._shapes: dict[str, Shape] = {}

    @property
    def validates_unseen(self) -> bool:
        """Whether no validation shape is fitted, nor an additional one of the same name."""
        fitted = {*self.fit_names, *(name for more in self.also for name in more.names)}
        return fitted.isdisjoint(self.validation_names)

    @property
    def watched(self) -> str:
        """What is validated on, in words."""
        count = len(self.validation_names)
        words = f"the last {count} training shapes"
        if self.holdout:
            words = f"{count} held-out training shapes"
        elif self.split.validation:
            words = f"{counted(count, 'held-out shape')} of the split"
        return words if self.validates_unseen else f"{words}, which are also fitted"

    @property
    def protocol(self) -> str:
        """One sentence for logs and results: what is fitted and what is validated on."""
        return f"{self.fitting}, validated on {self.watched}"

    @property
    def fitting(self) -> str:
        """What is fitted, in words."""
        sets = [(self.fit_names, self.train_set), *((more.names, more.shapes) for more in self.also)]
        fitted = " and ".join(f"{len(names)} shapes of {shapes.name}" for names, shapes in sets)
        return f"split {self.split.label}; fitted on {fitted}"

    def train_names(self) -> tuple[str, ...]:
        """Return the names of the shapes that are fitted or validated on; DataError if the set lacks one."""
        for part in ("train",) if self.holdout else ("train", "validation"):
            self.split.require(self.train_set.names, self.train_set.name, part)
        return tuple(dict.fromkeys([*self.split.train, *self.validation_names]))

    def test_names(self, shapes: ShapeSet) -> tuple[str, ...]:
        """Return the names of the split's test shapes; DataError if the set lacks one."""
        self.split.require(shapes.names, shapes.name, "test")
        return self.split.test

    def shape(self, name: str) -> Shape:
        """Return a training shape; it is read once and stays in memory."""
        if name not in self._shapes:
            self._shapes[name] = self.train_set.load(name)
        return self._shapes[name]

    def prepare(self) -> None:
        """Compute what the store lacks of the training shapes.

        Every shape is read once, here, and handed to the processes that prepare it.

        Raises
        ------
        DataError
            With a table of the shapes that cannot be used, if there are any.
        """
        names = self.train_names()
        jobs = [job for name in names if (job := self._missing(name)) is not None]
        jobs += [Job(more.shapes, name) for more in self.also for name in more.names]
        if not jobs:
            return
        summary = prepare(jobs, [self.recipe], self.store, workers=self.workers)
        if summary.failures:
            raise DataError(
                f"{len(summary.failures)} of {counted(len(jobs), 'shape')} cannot be used:\n{summary.table()}"
            )

    def _missing(self, name: str) -> Job | None:
        """Return what remains to be prepared of a training shape, or None if the store has everything."""
        try:
            shape = self.shape(name)
            if is_prepared(shape.mesh, self.recipe, self.store):
                return None
        except CsmError:
            return Job(self.train_set, name)  # the preparation fails in the same way and reports it with all others
        return Job(InMemory([shape], self.train_set.name), name)

    def prepared(self, name: str) -> Prepared:
        """Return features, basis and stencils of a training shape; what the store lacks is computed."""
        return prepare_mesh(self.shape(name).mesh, self.recipe, self.store)

    @property
    def n_classes(self) -> int:
        """Number of template points."""
        return self.shape(self.fit_names[0]).truth.n_from

    @property
    def also_classes(self) -> dict[str, int]:
        """Number of template points of each further template of the additional shapes, by its name."""
        return {more.template: more.n_classes for more in self.also if more.template}

    def validation_shapes(self) -> list[Shape]:
        """Return the meshes and truths of the validation shapes."""
        return [self.shape(name) for name in self.validation_names]


def distinct(sets: Sequence[ShapeSet]) -> list[ShapeSet]:
    """Return sets of which those from different folders that have one name are called by the ends of their paths.

    Folders `p/meshes` and `q/meshes` become the sets "p-meshes" and "q-meshes": results and messages call sets by name.
    """
    roots: dict[str, list[Path]] = {}
    for shapes in sets:
        known = roots.setdefault(shapes.name, [])
        if isinstance(shapes, FolderSet) and (root := shapes.root.resolve()) not in known:
            known.append(root)
    return [
        replace(shapes, name=_ending(shapes, roots[shapes.name]))
        if isinstance(shapes, FolderSet) and len(roots[shapes.name]) > 1
        else shapes
        for shapes in sets
    ]


def _ending(shapes: FolderSet, roots: Sequence[Path]) -> str:
    """Return as much of the end of the set's path as tells it from the other folders, with its name."""
    parts = [root.parts for root in roots]
    n = next(n for n in range(1, 1 + max(map(len, parts))) if len({p[-n:] for p in parts}) == len(parts))
    end = "-".join(shapes.root.resolve().parts[-n:]).replace("/", "")
    return end if end.endswith(shapes.name) else f"{end}-{shapes.name}"


def _by_name(sets: Sequence[ShapeSet]) -> dict[str, ShapeSet]:
    named = {shapes.name: shapes for shapes in sets}
    if len(named) != len(sets):
        raise DataError(
            f"the {len(sets)} test sets have only {len(named)} different names ({', '.join(named)}), by which results "
            "call them; rename the folders or name each set once"
        )
    return named


@dataclass(frozen=True)
class DataSet:
    """What the file of one data set declares, for `csm.data.registry`.

    Parameters
    ----------
    module
        The class of its data module.
    layouts
        The layouts in which it is published, in the order in which they are tried on a folder.
    splits
        The splits that it is used with; options call them by their names.
    """

    module: Callable[..., DataModule]
    layouts: tuple[Layout, ...] = ()
    splits: tuple[Split, ...] = ()
