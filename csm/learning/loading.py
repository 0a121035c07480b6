"""The data modules of csm as Lightning's trainer takes them: one shape per batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import overload

import lightning as L
from torch.utils.data import DataLoader

from csm.data.additional import Additional
from csm.data.base import DataModule
from csm.data.prepare import prepare_mesh
from csm.learning.samples import ShapeSample, n_bytes, shape_sample

ROOM = 6 * 2**30
"""Bytes of additional shapes that stay in memory; others are read from the store whenever they are trained on."""


class Samples(Sequence[ShapeSample]):
    """Samples that are made when they are asked for.

    Parameters
    ----------
    make
        Functions that return a sample each.
    """

    def __init__(self, make: Sequence[Callable[[], ShapeSample]]) -> None:
        self._make = make

    def __len__(self) -> int:
        return len(self._make)

    @overload
    def __getitem__(self, key: int) -> ShapeSample: ...
    @overload
    def __getitem__(self, key: slice) -> Samples: ...
    def __getitem__(self, key: int | slice) -> ShapeSample | Samples:
        return Samples(self._make[key]) if isinstance(key, slice) else self._make[key]()


class LightningData(L.LightningDataModule):
    """Loaders of the training and validation shapes of a data module.

    Parameters
    ----------
    data
        The data module, for example `csm.data.faust.FaustDataModule`.
    """

    def __init__(self, data: DataModule) -> None:
        super().__init__()
        self.data = data
        self._samples: dict[str, ShapeSample] = {}
        self._kept: dict[tuple[str, str], ShapeSample] = {}
        self._room = ROOM
        self._is_prepared = False

    def prepare_data(self) -> None:
        """Fill the store for the training shapes, once; Lightning calls this on one process only."""
        if not self._is_prepared:
            self.data.prepare()
            self._is_prepared = True

    def sample(self, name: str) -> ShapeSample:
        """Return the tensors of a training shape; they are made once and stay in memory."""
        if name not in self._samples:
            self._samples[name] = shape_sample(self.data.prepared(name), self.data.shape(name).truth)
        return self._samples[name]

    @property
    def n_features(self) -> int:
        """Width P of the input features."""
        return self.sample(self.data.fit_names[0]).features.shape[1]

    def fitted(self) -> Sequence[ShapeSample]:
        """Return the tensors of the fitted shapes and of those that are added to them; they are made when asked for."""
        own = [partial(self.sample, name) for name in self.data.fit_names]
        return Samples([*own, *(partial(self._added, more, name) for more in self.data.also for name in more.names)])

    def _added(self, more: Additional, name: str) -> ShapeSample:
        """Return the tensors of an additional shape, which stay in memory while there is room for them."""
        key = more.shapes.name, name
        if key in self._kept:
            return self._kept[key]
        shape = more.shapes.load(name)
        sample = shape_sample(prepare_mesh(shape.mesh, self.data.recipe, self.data.store), shape.truth, more.template)
        if self._room >= (size := n_bytes(sample)):
            self._room -= size
            self._kept[key] = sample
        return sample

    def train_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the fitted shapes in random order."""
        return self._loader(self.fitted(), shuffle=True)

    def val_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the validation shapes in order."""
        return self._loader([self.sample(name) for name in self.data.validation_names], shuffle=False)

    def _loader(self, samples: Sequence[ShapeSample], shuffle: bool) -> DataLoader[ShapeSample]:
        return DataLoader(samples, batch_size=None, shuffle=shuffle)  # type: ignore[arg-type]
