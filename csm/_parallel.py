"""A parallel map over processes of one thread each, with a progress bar, and calls in a fresh process."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sized
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

from csm._progress import progress_bar

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")


def n_processes(workers: int | None, n_tasks: int) -> int:
    """Return how many processes to start: as many as asked for; by default one per core, none for fewer than 3 tasks.

    Examples
    --------
    >>> n_processes(None, 2), n_processes(4, 2)
    (0, 4)
    """
    return workers if workers is not None else (os.cpu_count() or 1) if n_tasks > 2 else 0


def parallel_map(
    function: Callable[[T], R],
    tasks: Iterable[T],
    label: Callable[[T], str],
    workers: int,
    *,
    what: str,
    unit: str,
    total: int | None = None,
    progress: bool = True,
) -> list[R]:
    """Apply a function to every task, and return the results in the order of the tasks.

    Parameters
    ----------
    function
        A function of a module, so that processes can find it.
    tasks
        Objects that can be pickled.  They may be made one by one: a process works on the first while the next is made.
    label
        Names a task in the progress bar.
    workers
        Number of processes; up to 1 works in this process.
    what, unit
        Title and unit of the progress bar.
    total
        Number of tasks, where `tasks` has no length.
    progress
        Show the bar, with the name of the task that was done last and the estimated time left.
    """
    n = len(tasks) if isinstance(tasks, Sized) else total
    results: dict[int, R] = {}
    with progress_bar(total=n, desc=what, unit=unit, disable=not progress) as bar:
        for at, task, result in _run(function, tasks, workers if n is None or n > 1 else 1):
            results[at] = result
            bar.set_postfix_str(label(task), refresh=False)
            bar.update()
    return [results[at] for at in range(len(results))]


def _run(function: Callable[[T], R], tasks: Iterable[T], workers: int) -> Iterator[tuple[int, T, R]]:
    if workers <= 1:
        yield from ((at, task, _on_one_thread(function, task)) for at, task in enumerate(tasks))
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        running: dict[Future[R], tuple[int, T]] = {}
        try:
            for at, task in enumerate(tasks):
                running[pool.submit(_on_one_thread, function, task)] = at, task
                ready = [future for future in running if future.done()]
                if len(running) - len(ready) > 2 * workers:  # tasks that are made one by one do not pile up
                    ready = list(wait(running, return_when=FIRST_COMPLETED).done)
                yield from _finished(running, ready)
            while running:
                yield from _finished(running, wait(running, return_when=FIRST_COMPLETED).done)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _finished(running: dict[Future[R], tuple[int, T]], futures: Iterable[Future[R]]) -> Iterator[tuple[int, T, R]]:
    for future in futures:
        at, task = running.pop(future)
        yield at, task, future.result()


def _on_one_thread(function: Callable[[T], R], task: T) -> R:
    with threadpool_limits(1):
        return function(task)


def in_fresh_process(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a function of a module in a new process and return its result: nothing is warm, and memory is its own."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *args, **kwargs).result()
