"""Several processes that train one network together, one per device: what they share, and what only the first does.

A process is called by its rank, from 0 on.  All train the same weights, each on its own shapes (see
`csm.learning.loading`); rank 0 alone prepares the shapes, holds the lock of the folder, logs, prints and exports.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import lightning as L
import torch
from lightning.fabric.plugins.environments.lightning import LightningEnvironment
from lightning.pytorch.strategies import DDPStrategy, StrategyRegistry
from lightning.pytorch.utilities.seed import isolate_rng
from torch import Tensor, distributed, nn
from torch.nn.parallel import DistributedDataParallel

from csm.errors import ConfigError
from csm.learning.loading import LightningData

T = TypeVar("T")

NAME = "ranks"
"""What ``trainer.strategy`` calls `Ranks`."""

_KNOWN = inspect.signature(DistributedDataParallel).parameters
_OWN_BUFFERS = {"forward_sync_buffers" if "forward_sync_buffers" in _KNOWN else "broadcast_buffers": False}


class Ranks(DDPStrategy):
    """Lightning's DDP for trainings of csm: gradients are means over the ranks, whose shapes differ in size and parts.

    Random states are those of a training on one device, so that both draw the same order of shapes.  Statistics of
    batch normalisation are left to `SharedStatistics`.

    Parameters
    ----------
    options
        Of Lightning's `DDPStrategy`, such as ``timeout`` or ``process_group_backend``.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._ddp_kwargs |= _OWN_BUFFERS

    def setup_distributed(self) -> None:
        """Meet the other ranks; that draws no random numbers and sets no seed."""
        with isolate_rng():
            super().setup_distributed()

    def configure_ddp(self) -> None:
        """Wrap the module; a network with several classifiers uses one of them per shape."""
        self._ddp_kwargs.setdefault("find_unused_parameters", bool(len(getattr(self.model, "others", ()))))
        super().configure_ddp()


StrategyRegistry.register(NAME, Ranks, description="several devices train one network of csm")


class SharedStatistics(L.Callback):
    r"""Running statistics of batch normalisation over the shapes of all ranks, in the order of one process.

    From the statistics r before a step, rank k has made (1 - m) r + m s_k with those of its shape, s_k, and the
    momentum m.  One process would have gone on from rank to rank:

    .. math::
        r \leftarrow (1 - m) r + m s_k, \qquad k = 0 .. W - 1
    """

    def __init__(self) -> None:
        self._before: list[Tensor] = []

    def on_train_batch_start(self, trainer: L.Trainer, pl_module: L.LightningModule, *args: Any) -> None:
        """Keep the statistics before the step."""
        if trainer.world_size > 1:
            self._before = [x.clone() for x, _ in running_statistics(pl_module)]

    def on_train_batch_end(self, trainer: L.Trainer, pl_module: L.LightningModule, *args: Any) -> None:
        """Go on from rank to rank."""
        if trainer.world_size == 1 or not self._before:
            return
        own = [x for x, _ in running_statistics(pl_module)]
        every = torch.split(trainer.strategy.all_gather(torch.cat(own)), [len(x) for x in own], dim=1)
        for (x, keep), before, made in zip(running_statistics(pl_module), self._before, every, strict=True):
            x.copy_(before)
            for added in made - keep * before:
                x.mul_(keep).add_(added)


def running_statistics(module: nn.Module) -> Iterator[tuple[Tensor, float]]:
    """Yield running means and variances, shape (C,), and which part of them a new shape leaves as it is."""
    for part in module.modules():
        if isinstance(part, nn.BatchNorm1d) and part.running_mean is not None and part.running_var is not None:
            keep = 1 - float(part.momentum or 0)
            yield part.running_mean, keep
            yield part.running_var, keep


def require_one_or_ranks(trainer: L.Trainer) -> None:
    """Raise a ConfigError if a trainer has several devices and another strategy than `Ranks`."""
    if trainer.world_size > 1 and not isinstance(trainer.strategy, Ranks):
        raise ConfigError(
            f"trainer.devices={trainer.num_devices}, trainer.num_nodes={trainer.num_nodes}: several devices train "
            f'together with trainer=ddp (in Python strategy="{NAME}"), not with {type(trainer.strategy).__name__}; '
            "set trainer=ddp, or trainer.devices=1 trainer.num_nodes=1"
        )


def require_single_precision(trainer: L.Trainer) -> None:
    """Raise a ConfigError if the weights would not be in single precision, as descriptors and bases are."""
    if trainer.precision in ("64-true", "bf16-true", "16-true"):
        raise ConfigError(
            f"trainer.precision={trainer.precision}: descriptors and bases are in single precision; wanted 32-true, or "
            "bf16-mixed or 16-mixed for faster products"
        )


def is_started_from_outside(trainer: L.Trainer) -> bool:
    """Tell whether another program, such as srun or torchrun, starts all ranks, so that they can meet at any time."""
    environment = getattr(trainer.strategy, "cluster_environment", None)
    return trainer.world_size > 1 and not isinstance(environment, LightningEnvironment)


def prepare_once(trainer: L.Trainer, loaded: LightningData) -> None:
    """Fill the store for the training shapes in one process, while the other ranks wait.

    The first process of every further machine follows: it finds everything in a store that all share.
    """
    if not is_started_from_outside(trainer):
        if trainer.is_global_zero:  # Lightning starts the others after this
            loaded.prepare_data()
        loaded.is_prepared = True
        return
    trainer.strategy.setup_environment()
    first_here = trainer.local_rank == 0
    for turn in (trainer.is_global_zero, first_here and not trainer.is_global_zero):
        if turn:
            loaded.prepare_data()
        trainer.strategy.barrier()
    loaded.is_prepared = True


def require_same_begin(trainer: L.Trainer, folder: Path, begin: Path | None) -> None:
    """Raise a ConfigError if the ranks do not work in one folder, or do not see the same checkpoint to begin at."""
    if not is_started_from_outside(trainer):
        return
    mine = f"in {folder.absolute()}, from {begin.name if begin else 'the beginning'}"
    first = trainer.strategy.broadcast(mine)
    if first != mine:
        raise ConfigError(
            f"rank {trainer.global_rank} would train {mine}, and rank 0 {first}: all processes have to work in one "
            "folder that all machines share; give its path: hydra.run.dir=PATH"
        )


def gathered(trainer: L.Trainer, mine: T) -> list[T] | None:
    """Return on rank 0 what every rank has, in their order; None on the others."""
    if trainer.world_size == 1:
        return [mine]
    found: list[Any] | None = [None] * trainer.world_size if trainer.is_global_zero else None
    distributed.gather_object(mine, found, dst=0)
    return found


def part() -> None:
    """Leave the other ranks for good, once all are here; without others nothing happens."""
    if distributed.is_initialized():
        distributed.barrier()
        distributed.destroy_process_group()
