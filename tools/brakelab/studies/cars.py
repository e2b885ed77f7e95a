"""Studies of drawn cars, on all cores."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from brakelab.results.progress import tracked

Car = TypeVar("Car")


def each_car(name: str, drive: Callable[[int], Car], cars: int) -> list[Car]:
    """Return the results of `drive` for the cars 0 to `cars` - 1; `name` stands before the progress."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return list(tracked(pool.map(drive, range(cars)), name, cars))
