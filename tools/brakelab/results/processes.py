"""Processes of their own for work on many cars, draws or laws: one for each core."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from brakelab.results.progress import tracked

Job = TypeVar("Job")
Result = TypeVar("Result")


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0))


def new_pool(count: int | None = None) -> ProcessPoolExecutor:
    """Return an executor of `count` processes, by default one a core."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads of their own in every process cost more
    return ProcessPoolExecutor(count or cores(), mp_context=get_context("spawn"))


def run_each(text: str, work: Callable[[Job], Result], jobs: Sequence[Job]) -> list[Result]:
    """Return the results of `work` in the order of `jobs`; `text` stands before the progress."""
    with new_pool(min(cores(), len(jobs))) as pool:
        return list(tracked(pool.map(work, jobs), text, len(jobs)))
