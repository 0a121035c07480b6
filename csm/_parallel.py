"""A parallel map over processes of one thread each, with a progress bar, and calls in a fresh process."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from threading import Lock, local
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import threadpool_info, threadpool_limits

from csm._progress import progress_bar
from csm._workers import Worker, crew, death, ready
from csm.errors import ConfigError

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")


def n_processes(workers: int | None, n_tasks: int) -> int:
    """Return how many processes to start: as many as asked for; by default one per core, none for fewer than 3 tasks.

    Raises
    ------
    ConfigError
        If `workers` is neither None nor a whole number from 0 on.

    Examples
    --------
    >>> n_processes(None, 2), n_processes(4, 2)
    (0, 4)
    """
    if workers is None:
        return (os.cpu_count() or 1) if n_tasks > 2 else 0
    if isinstance(workers, bool) or not hasattr(workers, "__index__") or workers < 0:
        raise ConfigError(
            f"workers={workers}: wanted a whole number of processes (1 or 0 works in this process, without others), "
            "or null for one per core"
        )
    return int(workers)


def parallel_map(
    function: Callable[[T], R],
    tasks: Iterable[T],
    label: Callable[[T], str],
    workers: int | None,
    *,
    what: str,
    unit: str,
    total: int | None = None,
    progress: bool = True,
    on_result: Callable[[R], object] | None = None,
) -> list[R]:
    """Apply a function to every task, and return the results in the order of the tasks.

    The processes end with this call: at once if it is stopped by Ctrl-C, SIGTERM or an error, and also if this process
    is killed.

    Parameters
    ----------
    function
        A function of a module, so that processes can find it.
    tasks
        Objects that can be pickled.  They may be made one by one: a process works on the first while the next is made.
    label
        Names a task in the progress bar and in errors.
    workers
        Number of processes; up to 1 works in this process.  None: one per core, from when what is left, by the time
        that the first tasks took, is worth their start.
    what, unit
        Title and unit of the progress bar.
    total
        Number of tasks, where `tasks` has no length.
    progress
        Show the bar, with the name of the task that was done last and the estimated time left.
    on_result
        Called in this process with every result as soon as it is there.

    Raises
    ------
    ConfigError
        If `workers` is no number of processes, or one dies, for instance because memory runs out; names its task.
    """
    workers = None if workers is None else n_processes(workers, 1)
    n = len(tasks) if isinstance(tasks, Sized) else total
    results: dict[int, R] = {}
    with progress_bar(total=n, desc=what, unit=unit, disable=not progress) as bar:
        for at, task, result in _run(function, tasks, label, workers if n is None or n > 1 else 1):
            results[at] = result
            if on_result is not None:
                on_result(result)
            bar.set_postfix_str(label(task), refresh=False)
            bar.update()
    return [results[at] for at in range(len(results))]


def thread_map(function: Callable[[T], R], tasks: Sequence[T]) -> list[R]:
    """Apply a function to every task on as many threads as BLAS may use, with one BLAS thread each.

    It pays where the time goes into libraries that release the interpreter's lock.  In the processes of `parallel_map`,
    and within another such map, there is one thread.
    """
    allowed = min(len(tasks), max((pool["num_threads"] for pool in threadpool_info()), default=1))
    if allowed < 2 or getattr(_here, "mapped", False):  # the limit of OpenMP is not seen by the threads of a map
        return [function(task) for task in tasks]
    # A solver may set one BLAS thread and then back what it found: the outer limit keeps two of them from leaving each
    # other's setting behind.
    with _one_blas_thread(), ThreadPoolExecutor(allowed, initializer=_mark) as threads:
        return list(threads.map(function, tasks))


_here = local()


def _mark() -> None:
    """Note that this thread is one of a map."""
    _here.mapped = True


_WORTH = 10.0  # seconds of work that are left; processes import csm first, which takes some


def _run(
    function: Callable[[T], R], tasks: Iterable[T], label: Callable[[T], str], workers: int | None
) -> Iterator[tuple[int, T, R]]:
    if workers is None:
        yield from _run_when_worth(function, list(tasks), label)
        return
    if workers <= 1:
        yield from ((at, task, _on_one_thread(function, task)) for at, task in enumerate(tasks))
        return
    ahead = 1 if isinstance(tasks, Sized) else 2  # what is made one by one is sent before it is needed
    todo, more = enumerate(tasks), True
    with crew() as team:
        while more or any(worker.sent for worker in team):
            room = more and (len(team) < workers or any(len(worker.sent) < ahead for worker in team))
            if room and (made := next(todo, None)) is not None:
                _least_busy(team, function, workers).send(*made)
            else:
                more = more and not room
            for worker in ready(team, 0 if room else None):
                yield _take(worker, label)


def _run_when_worth(
    function: Callable[[T], R], tasks: list[T], label: Callable[[T], str]
) -> Iterator[tuple[int, T, R]]:
    """Work in this process until the tasks that are left would take it long, and on all cores then."""
    cores, began = os.cpu_count() or 1, time.perf_counter()
    for at, task in enumerate(tasks):
        left = (time.perf_counter() - began) / at * (len(tasks) - at) if at else 0.0
        if left > _WORTH and len(tasks) - at > 1:
            for more, one, result in _run(function, tasks[at:], label, cores):
                yield at + more, one, result
            return
        yield at, task, _on_one_thread(function, task)


def _least_busy(team: list[Worker], function: Callable[[T], R], workers: int) -> Worker:
    if len(team) < workers and all(worker.sent for worker in team):
        team.append(Worker(partial(_on_one_thread, function)))
    return min(team, key=lambda worker: len(worker.sent))


def _take(worker: Worker, label: Callable[[Any], str]) -> tuple[int, Any, Any]:
    at, task = worker.sent[0]
    try:
        return at, task, worker.take()
    except (EOFError, ConnectionError):
        died = death(worker, label(task))
    raise died


def _on_one_thread(function: Callable[[T], R], task: T) -> R:
    with _one_blas_thread():
        return function(task)


_held = 0
_limits: threadpool_limits | None = None
_lock = Lock()


@contextmanager
def _one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread; the last of those that overlap gives back what the first found."""
    global _held, _limits
    with _lock:
        if not _held:
            _limits = threadpool_limits(1)
        _held += 1
    try:
        yield
    finally:
        with _lock:
            _held -= 1
            if not _held and _limits is not None:
                _limits.restore_original_limits()


def in_fresh_process(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a function of a module in a new process and return its result: nothing is warm, and memory is its own."""
    with crew() as team:
        team.append(Worker(_called))
        team[0].send(0, partial(function, *args, **kwargs))
        ready(team, None)
        result: R = _take(team[0], lambda _: getattr(function, "__name__", "a function"))[2]
    return result


def _called(call: Callable[[], R]) -> R:
    return call()
