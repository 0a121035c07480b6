"""The data modules of csm as Lightning's trainer takes them: one shape per batch.

Where several processes train one network together, each has its own share of the shapes: of every epoch, which all of
them go through in one order, rank r of W takes the shapes r, r + W, r + 2 W, ...  A step of W processes therefore sees
the shapes that one process sees in W batches, as with ``accumulate_grad_batches=W``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple, overload

import lightning as L
from torch.utils.data import DataLoader, RandomSampler, Sampler

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


class Share(NamedTuple):
    """Which of the processes that train together this one is: `rank` of `ranks`."""

    rank: int = 0
    ranks: int = 1

    def of(self, items: Sequence[int]) -> list[int]:
        """Return every `ranks`-th item from number `rank` on; the first items follow the last, so that all get as many.

        Examples
        --------
        >>> Share(0, 2).of([5, 6, 7]), Share(1, 2).of([5, 6, 7])
        ([5, 7], [6, 5])
        """
        each = -(-len(items) // self.ranks)
        return [items[(self.rank + i * self.ranks) % len(items)] for i in range(each)] if items else []


class SharedOrder(Sampler[int]):
    """The share of one process in an epoch, in an order that is drawn anew for every epoch.

    Parameters
    ----------
    n
        Number of shapes.
    share
        Of this process.
    agree
        Takes an order and returns that of rank zero, the same in all processes.
    """

    def __init__(self, n: int, share: Share, agree: Callable[[list[int]], list[int]]) -> None:
        self.n, self.share, self.agree = n, share, agree

    def __iter__(self) -> Iterator[int]:
        """Draw an order as a single process does, and go through the share of this one."""
        yield from self.share.of(self.agree(list(RandomSampler(range(self.n)))))

    def __len__(self) -> int:
        """Return the number of shapes per epoch and process."""
        return len(self.share.of(range(self.n)))


UNSEEN, FITTED = "val", "fit"
"""What the metrics of validation shapes are called by: shapes that are held out of the fit, and those that are not."""


def metric_group(trainer: L.Trainer | None) -> str:
    """Return `FITTED` if the validation shapes of a training are also fitted; else, or without one, `UNSEEN`."""
    loaded = getattr(trainer, "datamodule", None)
    return FITTED if isinstance(loaded, LightningData) and not loaded.data.validates_unseen else UNSEEN


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
        self.is_prepared = False

    def prepare_data(self) -> None:
        """Fill the store for the training shapes, once; Lightning calls this on one process only."""
        if not self.is_prepared:
            self.data.prepare()
            self.is_prepared = True

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

    @property
    def share(self) -> Share:
        """Which of the processes that train together this one is."""
        return Share() if self.trainer is None else Share(self.trainer.global_rank, self.trainer.world_size)

    def train_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the fitted shapes in random order, or the share of this process in them."""
        samples = self.fitted()
        if self.trainer is None or self.share.ranks == 1:
            return self._loader(samples, shuffle=True)
        return self._loader(samples, sampler=SharedOrder(len(samples), self.share, self.trainer.strategy.broadcast))

    def val_dataloader(self) -> DataLoader[ShapeSample]:
        """Return the validation shapes in order, or the share of this process in them.

        What is there again, so that all processes have as many, does not count: all together count each shape once.
        (Lightning rounds the mean of these weights over W processes to a whole number, so one shape has weight W.)
        """
        names, (rank, ranks) = self.data.validation_names, self.share
        mine = enumerate(self.share.of(range(len(names))))
        weights = ((names[j], ranks if rank + i * ranks < len(names) else 0) for i, j in mine)
        return self._loader([self.sample(name)._replace(counts=weight) for name, weight in weights])

    def _loader(self, samples: Sequence[ShapeSample], **how: Any) -> DataLoader[ShapeSample]:
        return DataLoader(samples, batch_size=None, **how)  # type: ignore[arg-type]
