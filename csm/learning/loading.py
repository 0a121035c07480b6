"""The data modules of csm as Lightning's trainer takes them: one shape per batch, all in memory."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import lightning as L
from torch.utils.data import DataLoader

from csm.data.base import DataModule
from csm.data.prepare import prepare_mesh
from csm.learning.samples import ShapeSample, shape_sample


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

    def fitted(self) -> list[ShapeSample]:
        """Return the tensors of the fitted shapes and of those that are added to them."""
        return [self.sample(name) for name in self.data.fit_names] + self._also

    @cached_property
    def _also(self) -> list[ShapeSample]:
        found = []
        for more in self.data.also:
            for name in more.names:
                shape = more.shapes.load(name)
                prepared = prepare_mesh(shape.mesh, self.data.recipe, self.data.store)
                found.append(shape_sample(prepared, shape.truth, more.template))
        return found

    def train_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the fitted shapes in random order."""
        return self._loader(self.fitted(), shuffle=True)

    def val_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the validation shapes in order."""
        return self._loader([self.sample(name) for name in self.data.validation_names], shuffle=False)

    def _loader(self, samples: Sequence[ShapeSample], shuffle: bool) -> DataLoader[ShapeSample]:
        return DataLoader(samples, batch_size=None, shuffle=shuffle)  # type: ignore[arg-type]
