from __future__ import annotations

import os

import pytest
from threadpoolctl import threadpool_info

from csm._parallel import in_fresh_process, parallel_map


def square(x: int) -> int:
    if x < 0:
        raise ValueError("negative")
    return x * x


def process_and_threads(_: int) -> tuple[int, int]:
    return os.getpid(), max((library["num_threads"] for library in threadpool_info()), default=1)


def squares(tasks: list[int], workers: int) -> list[int]:
    return parallel_map(square, tasks, str, workers, what="square", unit="number")


@pytest.mark.parametrize("workers", [0, 1, 2])
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


@pytest.mark.parametrize("workers", [1, 2])
def test_tasks_may_be_made_one_by_one(workers):
    tasks = (x for x in [3, 1, 2])
    assert parallel_map(square, tasks, str, workers, what="square", unit="number", total=3) == [9, 1, 4]


def test_a_fresh_process_is_another_one():
    process, _ = in_fresh_process(process_and_threads, 0)
    assert process != os.getpid()
