"""Worker processes that take tasks one by one and end, whatever happens, with the process that started them."""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.reduction import ForkingPickler
from types import FrameType
from typing import Any, TypeAlias

from csm.errors import ConfigError

PATIENCE = 1.0
"""Seconds that workers get to put their files in order when they are stopped; then they are killed."""

_Todo: TypeAlias = "queue.SimpleQueue[tuple[Any, Exception | None] | None]"
"""Tasks, each with the error that reading it gave, and None after the last."""

_context = multiprocessing.get_context("spawn")


class Worker:
    """A fresh process that applies one function to the tasks it is sent, in their order.

    Parameters
    ----------
    function
        A function of a module, so that the process can find it.

    Attributes
    ----------
    sent
        Numbers and tasks that are not answered yet; the process works on the first of them.
    """

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.sent: deque[tuple[int, Any]] = deque()
        tasks, self._tasks = _context.Pipe(duplex=False)
        self.answers, answers = _context.Pipe(duplex=False)
        self.process = _context.Process(target=_serve, args=(function, tasks, answers))
        with _no_interrupt():
            self.process.start()
        tasks.close()
        answers.close()

    def send(self, at: int, task: Any) -> None:
        """Give the process a task; one that has died is found when its answer is taken."""
        self.sent.append((at, task))
        with suppress(OSError):
            self._tasks.send((task, None))

    def take(self) -> Any:
        """Return the answer to the first task that was sent, or raise the error that it ended with.

        Raises
        ------
        EOFError
            If the process has died.
        """
        ok, result, trace = self.answers.recv()
        self.sent.popleft()
        if ok:
            return result
        raise result from RemoteTraceback(trace)

    def finish(self) -> None:
        """Ask the process to end after its last task."""
        with suppress(OSError):
            self._tasks.send(None)

    def close(self) -> None:
        """Give the pipes back."""
        self._tasks.close()
        self.answers.close()


class RemoteTraceback(Exception):  # noqa: N818 - it is never raised, only the cause of what is
    """The traceback of an error in a worker, as text."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


@contextmanager
def crew() -> Iterator[list[Worker]]:
    """Give a list for workers; all that are in it are ended with the block, and at once if it raises."""
    workers: list[Worker] = []
    try:
        yield workers
        for worker in workers:
            worker.finish()
        _join(workers, 10 * PATIENCE)
    finally:
        try:
            _stop(workers)
        finally:
            for worker in workers:
                worker.process.kill()
                worker.process.join()
                worker.close()


def ready(workers: Sequence[Worker], timeout: float | None) -> list[Worker]:
    """Return the workers that have an answer or have died, waiting for the first of them."""
    busy = [worker for worker in workers if worker.sent]
    signs = [sign for worker in busy for sign in (worker.answers, worker.process.sentinel)]
    seen = wait(signs, timeout) if busy else []
    return [worker for worker in busy if worker.answers in seen or worker.process.sentinel in seen]


def death(worker: Worker, task: str) -> ConfigError:
    """Return the error for a worker that has died at a task."""
    # A signal to the whole group of processes reaches this one too, though perhaps later: then it is what is raised.
    time.sleep(0.3)
    worker.process.join(PATIENCE)
    code = worker.process.exitcode
    if code is not None and code < 0:
        how = f"was ended by the operating system (signal {-code}), probably because memory ran out"
        return ConfigError(f"{task}: the process that worked on it {how}; try again with fewer workers (workers=1)")
    return ConfigError(
        f"{task}: the process that worked on it ended with status {code} and no answer; what it printed above says why "
        '(a script that calls csm needs a line `if __name__ == "__main__":`), or try workers=1, without processes'
    )


def _stop(workers: Sequence[Worker]) -> None:
    for worker in workers:
        worker.process.terminate()
    _join(workers, PATIENCE)


def _join(workers: Sequence[Worker], seconds: float) -> None:
    end = time.monotonic() + seconds
    for worker in workers:
        worker.process.join(max(0.0, end - time.monotonic()))


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Keep Ctrl-C from a process until it can ignore it: a process that is started has this one's blocked signals."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # it unblocks the signals when it is started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(function: Callable[[Any], Any], tasks: Connection, answers: Connection) -> None:
    """Run in the worker: apply the function to every task until there are no more."""
    _obey_parent_only()
    todo: _Todo = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(tasks, todo), daemon=True).start()
    while (given := todo.get()) is not None:
        answer = _answer(function, *given)
        try:
            answers.send(answer)
        except BrokenPipeError:
            return
        except Exception as error:  # the result cannot be pickled
            answers.send(_failure(error))


def _obey_parent_only() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent too, and the parent ends its workers
    signal.signal(signal.SIGTERM, _leave)
    sys.unraisablehook = _leave_after_all
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: also where a computation blocks the other watch


def _leave(_signal: int, _frame: FrameType | None) -> None:
    sys.exit(128 + signal.SIGTERM)


def _leave_after_all(dropped: sys.UnraisableHookArgs) -> None:
    """Send the signal to leave again if it came while an object was deleted, where Python drops what is raised."""
    if isinstance(dropped.exc_value, SystemExit):
        threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGTERM)).start()
    else:
        sys.__unraisablehook__(dropped)


def _receive(tasks: Connection, todo: _Todo) -> None:
    """Pass tasks on as they come; the pipe's end means that the parent is gone, and then so is this process."""
    while True:
        try:
            todo.put(tasks.recv())
        except (EOFError, OSError):
            os._exit(1)
        except Exception as error:  # a task that cannot be unpickled
            todo.put((None, error))


def _answer(function: Callable[[Any], Any], task: Any, unreadable: Exception | None) -> tuple[bool, Any, str]:
    try:
        if unreadable is not None:
            raise unreadable
        return True, function(task), ""
    except Exception as error:
        return _failure(error)


def _failure(error: Exception) -> tuple[bool, Any, str]:
    trace = "".join(traceback.format_exception(error))
    try:
        ForkingPickler.loads(ForkingPickler.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    return False, error, trace
