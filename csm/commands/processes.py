"""The processes of ``csm train trainer=ddp``, one per device, which PyTorch's launcher (torchrun) starts and watches.

The command itself only waits for them.  So each job of a sweep begins afresh, and when one process fails the others are
ended.  Under another starter, such as srun or torchrun, every process is a command of its own and nothing is started.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.hydra_config import HydraConfig

from csm._signals import Stopped, Terminated, saying
from csm.errors import ConfigError
from csm.evaluation.provenance import remembered_command

if TYPE_CHECKING:
    from csm.experiments.training import Training

_TYPED = "CSM_COMMAND"
"""Environment variable with the command line that the user typed, for the processes that it starts."""

_RANKS = ("RANK", "SLURM_PROCID", "LOCAL_RANK")


def typed_command() -> list[str] | None:
    """Return the command line that started this process for its help, if one did."""
    return json.loads(os.environ[_TYPED]) if _TYPED in os.environ else None


def end_with_parent() -> None:
    """Let SIGTERM end this process when the command that started it is killed (on Linux)."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


def is_first() -> bool:
    """Tell whether this process speaks for all that were started together; a process alone does."""
    return next((os.environ[name] for name in _RANKS if name in os.environ), "0") == "0"


def processes_to_start(training: Training, folder: Path) -> int:
    """Return how many processes this command has to start for a training; 0 if it trains by itself.

    Raises
    ------
    ConfigError
        If the settings of the trainer do not fit, or the processes of several machines are wanted of one command.
    """
    from csm.experiments.ranks import is_started_from_outside
    from csm.experiments.trainer import make_trainer

    trainer = make_trainer(training, folder)
    if trainer.world_size == 1 or is_started_from_outside(trainer):
        return 0
    if trainer.num_nodes > 1:
        raise ConfigError(
            f"trainer.num_nodes={trainer.num_nodes}: one command cannot start processes on other machines; start it on "
            f"all of them, as in srun --nodes={trainer.num_nodes} --ntasks-per-node={trainer.num_devices} csm train "
            "..., or with torchrun, and give all the same folder: hydra.run.dir=PATH"
        )
    return int(trainer.num_devices)


def train_together(processes: int, folder: Path) -> dict[str, Any]:
    """Start this job in several processes of this machine, and return the numbers that they leave in its folder.

    Raises
    ------
    ConfigError
        If one of them fails, which has said why.
    """
    from torch.distributed.elastic.multiprocessing.errors import ChildFailedError
    from torch.distributed.launcher.api import LaunchConfig, elastic_launch

    config = LaunchConfig(
        min_nodes=1,
        max_nodes=1,
        nproc_per_node=processes,
        run_id=uuid.uuid4().hex,
        rdzv_backend="c10d",
        rdzv_endpoint="localhost:0",
        max_restarts=0,
    )
    result = folder / "result.json"
    result.unlink(missing_ok=True)
    words = job_words(folder)
    try:
        with saying(lambda: f"its {processes} processes say above what is kept"), _watched(processes):
            elastic_launch(config, sys.executable)("-m", "csm.commands.train", *words)
    except ChildFailedError as error:
        rank, failure = error.get_first_failure()
        raise ConfigError(
            f"rank {rank} of the {processes} processes that train together ended with status {failure.exitcode}, and "
            "the others were stopped; what it said above tells why"
        ) from None
    found: dict[str, Any] = json.loads(result.read_text())
    return {key: value for key, value in found.items() if key not in ("status", "overrides", "settings")}


def job_words(folder: Path) -> list[str]:
    """Return the options with which another process does the running job of Hydra, in the same folder."""
    hydra = HydraConfig.get()
    sources = [source.path for source in hydra.runtime.config_sources if source.provider == "command-line"]
    quoted = str(folder.absolute()).replace("\\", "\\\\").replace("'", "\\'")
    return [
        *map(str, hydra.overrides.task),
        f"hydra.run.dir='{quoted}'",
        "hydra.output_subdir=null",
        "hydra/job_logging=stdout",
        *(word for path in sources for word in ("--config-dir", str(path))),
    ]


@contextmanager
def _watched(processes: int) -> Iterator[None]:
    """Run PyTorch's launcher with its log quiet, and put what it turns signals into back into words of csm."""
    from torch.distributed.elastic.multiprocessing.api import SignalException

    before = dict(os.environ)
    os.environ[_TYPED] = json.dumps(remembered_command())
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // processes)))
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    logging.getLogger("torch.distributed.elastic").setLevel(logging.CRITICAL)
    try:
        yield
    except SignalException as stop:
        raise (Terminated if stop.sigval == signal.SIGTERM else Stopped)() from None
    finally:
        os.environ.clear()
        os.environ.update(before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
