"""Lightning data modules: shapes in memory, one shape per batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import lightning as L
import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader

from csm._types import Arrays
from csm.data.prepare import Job, Prepared, Recipe, prepare, prepare_shape
from csm.data.shapeset import Shape, ShapeSet
from csm.data.splits import Split, read_split
from csm.data.store import Store
from csm.descriptors.base import Descriptor
from csm.errors import DataError
from csm.networks.basis import Basis
from csm.networks.surface import Surface
from csm.operators.stencils import Stencil


class ShapeSample(NamedTuple):
    """One shape as a network sees it.

    Shapes: `features` (N, P); `surface` with K eigenpairs; `rows` (R,) vertices with a known template point and
    `classes` (R,) that point.
    """

    name: str
    features: Tensor
    surface: Surface
    rows: Tensor
    classes: Tensor


class Loaded(NamedTuple):
    """A shape and its tensors."""

    shape: Shape
    sample: ShapeSample


def to_sample(prepared: Prepared) -> ShapeSample:
    """Convert a prepared shape to float32 tensors."""
    truth = prepared.shape.truth.indices
    classes = np.flatnonzero(truth >= 0)
    spectrum = prepared.basis
    basis = Basis(*(torch.as_tensor(a, dtype=torch.float32) for a in (spectrum.evals, spectrum.evecs, spectrum.mass)))
    return ShapeSample(
        prepared.shape.name,
        torch.as_tensor(prepared.features),
        Surface(basis, {name: _tensors(arrays) for name, arrays in prepared.stencils.items()}),
        torch.as_tensor(truth[classes]),
        torch.as_tensor(classes),
    )


def _tensors(arrays: Arrays) -> dict[str, Tensor]:
    """Convert to float32 and int64."""
    kinds = {"f": torch.float32, "i": torch.int64}
    return {key: torch.as_tensor(value).to(kinds[value.dtype.kind]) for key, value in arrays.items()}


class CorrespondenceDataModule(L.LightningDataModule):
    """Base of all data modules: a training set, any number of test sets over the same template, one split.

    Parameters
    ----------
    train_set
        Set that the training and validation shapes come from.
    test_sets
        Sets to test on; each is called by its own name in results.
    split
        A split, or the path of a split file.
    descriptor
        Gives the input features.
    basis_k
        Eigenpairs kept per shape; a network may use fewer.
    holdout
        How many shapes, the last of the training list, are kept out of the fit to validate on. With 0 the last ten
        training shapes serve for validation although they are fitted, and the validation error is no more than a sign
        of life.
    store
        Where features and bases are kept.
    workers
        Processes for the preparation and for the distances of tests, see `csm._processes.processes`.
    stencils
        What else the network wants to know of a shape, see `csm.operators.stencils`.
    """

    def __init__(
        self,
        train_set: ShapeSet,
        test_sets: Sequence[ShapeSet],
        split: Split | str | Path,
        descriptor: Descriptor,
        basis_k: int = 128,
        holdout: int = 0,
        store: Store | None = None,
        workers: int | None = None,
        stencils: Sequence[Stencil] = (),
    ) -> None:
        super().__init__()
        self.train_set = train_set
        self.test_sets: Mapping[str, ShapeSet] = {s.name: s for s in test_sets}
        self.split = split if isinstance(split, Split) else read_split(split)
        self.recipe = Recipe(descriptor, basis_k, tuple(stencils))
        self.store = store or Store()
        self.workers = workers
        self.holdout = holdout
        self.fit_names, held_out = self.split.held_out(holdout)
        self.validation_names = held_out or self.split.train[-10:]
        self._loaded: dict[tuple[str, str], Loaded] = {}

    @property
    def protocol(self) -> str:
        """One sentence for logs and results: what is fitted and what is validated on."""
        seen = f"the last {len(self.validation_names)} training shapes, which are also fitted"
        held = f"{self.holdout} held-out training shapes"
        return (
            f"split {self.split.label}; fitted on {len(self.fit_names)} shapes of {self.train_set.name}, "
            f"validated on {held if self.holdout else seen}"
        )

    def prepare_data(self) -> None:
        """Fill the store for the training shapes; Lightning calls this on one process only."""
        self.fill([Job(self.train_set, name) for name in self.train_names()])

    def fill(self, jobs: Sequence[Job]) -> None:
        """Prepare shapes; raise a DataError with the table of failures if there are any."""
        summary = prepare(jobs, self.recipe, self.store, workers=self.workers)
        if summary.failures:
            raise DataError(f"{len(summary.failures)} of {len(jobs)} shapes cannot be used:\n{summary.table()}")

    def train_names(self) -> tuple[str, ...]:
        """Return the names of the split's training shapes; DataError if the set lacks one."""
        return self._require("train", self.train_set)

    def test_names(self, shapes: ShapeSet) -> tuple[str, ...]:
        """Return the names of the split's test shapes; DataError if the set lacks one."""
        return self._require("test", shapes)

    def _require(self, part: str, shapes: ShapeSet) -> tuple[str, ...]:
        self.split.require(shapes.names, shapes.name, part)
        names: tuple[str, ...] = getattr(self.split, part)
        return names

    def load(self, shapes: ShapeSet, name: str) -> Loaded:
        """Return one shape with its tensors; it stays in memory."""
        key = (shapes.name, name)
        if key not in self._loaded:
            shape = shapes.load(name)
            self._loaded[key] = Loaded(shape, to_sample(prepare_shape(shape, self.recipe, self.store)))
        return self._loaded[key]

    @property
    def n_features(self) -> int:
        """Width P of the input features."""
        return self._first.sample.features.shape[1]

    @property
    def n_classes(self) -> int:
        """Number of template points."""
        return self._first.shape.truth.n_from

    @property
    def _first(self) -> Loaded:
        return self.load(self.train_set, self.fit_names[0])

    def validation_shapes(self) -> list[Shape]:
        """Return the meshes and truths of the validation shapes."""
        return [self.load(self.train_set, name).shape for name in self.validation_names]

    def train_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the fitted shapes in random order."""
        return self._loader(self.fit_names, shuffle=True)

    def val_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the validation shapes in order."""
        return self._loader(self.validation_names, shuffle=False)

    def _loader(self, names: Sequence[str], shuffle: bool) -> DataLoader[ShapeSample]:
        samples = [self.load(self.train_set, name).sample for name in names]
        return DataLoader(samples, batch_size=None, shuffle=shuffle)  # type: ignore[arg-type]
