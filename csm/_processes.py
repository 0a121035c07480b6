"""Do the same to many things in processes of one thread each, with a bar that names them."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from typing import TypeVar

from threadpoolctl import threadpool_limits

from csm._progress import progress_bar

T = TypeVar("T")
R = TypeVar("R")


def processes(workers: int | None, n_jobs: int) -> int:
    """Return how many processes to start: as many as asked for; by default one per core, none for fewer than 3 jobs.

    Examples
    --------
    >>> processes(None, 2), processes(4, 2)
    (0, 4)
    """
    return workers if workers is not None else (os.cpu_count() or 1) if n_jobs > 2 else 0


def run_all(
    function: Callable[[T], R],
    tasks: Sequence[T],
    label: Callable[[T], str],
    workers: int,
    *,
    what: str,
    unit: str,
    progress: bool = True,
) -> list[R]:
    """Return what `function` gives for every task, in their order.

    Parameters
    ----------
    function
        Of a module, as processes are to find it.
    tasks
        Plain objects.
    label
        Names a task in the bar.
    workers
        Processes; up to 1 works in this process.
    what, unit
        Of the bar.
    progress
        Show the bar, with the name of the task done last and the estimated time left.
    """
    results: dict[int, R] = {}
    with progress_bar(total=len(tasks), desc=what, unit=unit, disable=not progress) as bar:
        for at, result in _run(function, tasks, workers):
            results[at] = result
            bar.set_postfix_str(label(tasks[at]), refresh=False)
            bar.update()
    return [results[at] for at in range(len(tasks))]


def _run(function: Callable[[T], R], tasks: Sequence[T], workers: int) -> Iterator[tuple[int, R]]:
    if workers <= 1 or len(tasks) <= 1:
        yield from ((at, _on_one_thread(function, task)) for at, task in enumerate(tasks))
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        running: dict[Future[R], int] = {
            pool.submit(_on_one_thread, function, task): at for at, task in enumerate(tasks)
        }
        try:
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _on_one_thread(function: Callable[[T], R], task: T) -> R:
    with threadpool_limits(1):
        return function(task)
