"""What ends processes of sweeps in the middle of their work."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import lightning as L


class KillOnce(L.Callback):
    """End the process of the training with seed 1 at the start of an epoch, once, as a lost machine does.

    Parameters
    ----------
    epoch
        Counted from 0.
    flag
        A file that says that it has happened.
    """

    def __init__(self, epoch: int, flag: str) -> None:
        self.epoch, self.flag = epoch, Path(flag)

    def on_train_epoch_start(self, trainer, pl_module):
        seed = pl_module.hparams["training"]["seed"]
        if (seed, trainer.current_epoch) == (1, self.epoch) and not self.flag.exists():
            self.flag.write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGKILL)


def kill_worker(title: bytes, store: Path, when: Callable[[], bool], seconds: float) -> int | None:
    """Kill a process with such a title that works on a store (`CSM_CACHE`), and return its number.

    Parameters
    ----------
    title
        What its command line begins with.
    store
        Of this test; other processes are not touched.
    when
        Is waited for, up to so many `seconds`.
    """
    end = time.monotonic() + seconds
    mine = b"CSM_CACHE=" + os.fsencode(store)
    while time.monotonic() < end:
        for place in Path("/proc").glob("[0-9]*") if when() else ():
            try:
                found = (place / "cmdline").read_bytes().startswith(title)
                if found and mine in (place / "environ").read_bytes().split(b"\0"):
                    os.kill(int(place.name), signal.SIGKILL)
                    return int(place.name)
            except OSError:
                continue
        time.sleep(0.02)
    return None
