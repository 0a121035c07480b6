from __future__ import annotations

import os
import threading
from collections.abc import Callable

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from csm._parallel import in_fresh_process, n_processes, parallel_map, thread_map
from csm.errors import ConfigError


def square(x: int) -> int:
    if x < 0:
        raise ValueError("negative")
    return x * x


def process_and_threads(_: int) -> tuple[int, int]:
    return os.getpid(), max((library["num_threads"] for library in threadpool_info()), default=1)


def squares(tasks: list[int], workers: int) -> list[int]:
    return parallel_map(square, tasks, str, workers, what="square", unit="number")


@pytest.mark.parametrize("workers", [0, 1, 2, None])
def test_results_come_in_the_order_of_the_tasks(workers):
    assert squares([3, 1, 2], workers) == [9, 1, 4]
    assert squares([], workers) == []


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_ends_the_run(workers):
    with pytest.raises(ValueError, match="negative"):
        squares([1, -1, 2], workers)


def test_workers_are_other_processes_of_one_thread():
    found = parallel_map(process_and_threads, [0, 0], str, 2, what="ask", unit="worker")
    assert os.getpid() not in {process for process, _ in found}
    assert {threads for _, threads in found} == {1}


def test_quick_tasks_start_no_processes():
    found = parallel_map(process_and_threads, range(5), str, None, what="ask", unit="process")
    assert {process for process, _ in found} == {os.getpid()}


def test_long_tasks_start_processes_after_the_first(monkeypatch):
    monkeypatch.setattr("csm._parallel._WORTH", 0.0)
    monkeypatch.setattr("csm._parallel.os.cpu_count", lambda: 2)
    first, *others = parallel_map(process_and_threads, range(4), str, None, what="ask", unit="process")
    assert first[0] == os.getpid()
    assert os.getpid() not in {process for process, _ in others}
    assert squares([3, 1, 2], None) == [9, 1, 4]


@pytest.mark.parametrize("workers", [1, 2])
def test_tasks_may_be_made_one_by_one(workers):
    tasks = (x for x in [3, 1, 2])
    assert parallel_map(square, tasks, str, workers, what="square", unit="number", total=3) == [9, 1, 4]


def test_a_fresh_process_is_another_one():
    process, _ = in_fresh_process(process_and_threads, 0)
    assert process != os.getpid()


@pytest.mark.parametrize("workers", [0, 2])
def test_results_are_handed_out_as_they_come(workers):
    found = []
    with pytest.raises(ValueError, match="negative"):
        parallel_map(square, iter([3, 1, -2]), str, workers, what="square", unit="number", on_result=found.append)
    assert set(found) <= {9, 1}
    if workers == 0:
        assert found == [9, 1]


@pytest.mark.parametrize("workers", [-1, 1.5, True, "abc", "2", [2]])
def test_a_number_of_workers_that_is_none_is_refused(workers):
    with pytest.raises(ConfigError, match=r"^workers=.*wanted a whole number of processes"):
        n_processes(workers, 5)


@pytest.mark.parametrize("workers", [0, 3, np.int64(3)])
def test_a_number_of_workers_is_taken_as_it_is(workers):
    assert n_processes(workers, 5) == workers


def test_threads_keep_the_order_and_leave_the_blas_limit_as_it_was():
    before = [pool["num_threads"] for pool in threadpool_info()]
    assert thread_map(lambda x: x * x, range(50)) == [x * x for x in range(50)]
    assert [pool["num_threads"] for pool in threadpool_info()] == before


def test_threads_within_threads_are_one():
    def inside(_: int) -> set[int]:
        return set(thread_map(lambda _: threading.get_ident(), range(4)))

    assert all(len(found) == 1 for found in thread_map(inside, range(4)))


def test_maps_that_overlap_give_back_the_threads_that_the_first_found():
    """The one that began first ends first, and the other must not keep what it found in between."""
    before = [library["num_threads"] for library in threadpool_info()]
    both, first = threading.Barrier(2), threading.Event()

    def early(_: int) -> None:
        both.wait(10)

    def late(_: int) -> None:
        both.wait(10)
        first.wait(10)

    def one(task: Callable[[int], None]) -> None:
        parallel_map(task, [1], str, 1, what="wait", unit="number", progress=False)

    threads = [threading.Thread(target=one, args=(task,)) for task in (early, late)]
    for thread in threads:
        thread.start()
    threads[0].join(10)
    first.set()
    threads[1].join(10)
    assert [library["num_threads"] for library in threadpool_info()] == before
