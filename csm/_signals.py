"""Ctrl-C and SIGTERM: both stop a command in an orderly way, with a sentence that says what is kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


class Stopped(KeyboardInterrupt):
    """Ctrl-C, with a sentence that says what is kept and how to go on as its argument."""


class Terminated(KeyboardInterrupt):
    """SIGTERM, which cluster schedulers send; like Ctrl-C it may have a sentence as its argument."""


def exit_status(stop: KeyboardInterrupt) -> int:
    """Return the exit status that shells expect: 128 and the number of the signal.

    Examples
    --------
    >>> exit_status(KeyboardInterrupt()), exit_status(Terminated("2 of 3 shapes are kept"))
    (130, 143)
    """
    return 143 if isinstance(stop, Terminated) else 130


@contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM raise `Terminated` in the main thread while the block runs; in another thread nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


@contextmanager
def saying(message: Callable[[], str]) -> Iterator[None]:
    """Add a sentence to a Ctrl-C or SIGTERM that stops the block, unless something inside has added one already.

    Parameters
    ----------
    message
        Called when the block is stopped; says what is kept and how to go on.
    """
    try:
        yield
    except KeyboardInterrupt as stop:
        if stop.args:
            raise
        kind = Terminated if isinstance(stop, Terminated) else Stopped
        raise kind(message()) from None


def _terminate(_signal: int, _frame: FrameType | None) -> None:
    raise Terminated
