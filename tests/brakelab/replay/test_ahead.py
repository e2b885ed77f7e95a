"""Blocks that another thread prepares come as if it were not there."""

import threading
from collections.abc import Iterator

import pytest

from brakelab.replay.ahead import DEPTH, read_ahead


def blocks(count: int, fails_at: int = -1) -> Iterator[int]:
    for number in range(count):
        if number == fails_at:
            raise ValueError(f"block {number} is damaged")
        yield number


@pytest.mark.parametrize("count", [0, 1, DEPTH, DEPTH + 1, 100])
def test_all_blocks_come_in_their_order(count: int) -> None:
    assert list(read_ahead(blocks(count))) == list(range(count))


@pytest.mark.parametrize("fails_at", [0, 1, DEPTH + 3])
def test_an_error_comes_behind_the_blocks_before_it(fails_at: int) -> None:
    came: list[int] = []
    with pytest.raises(ValueError, match=f"block {fails_at} is damaged"):
        came.extend(read_ahead(blocks(20, fails_at)))  # what came is lost in an error …
    ahead = read_ahead(blocks(20, fails_at))
    assert [next(ahead) for _ in range(fails_at)] == list(range(fails_at))  # … so one by one


@pytest.mark.parametrize("taken", [0, 1, 2 * DEPTH])
def test_who_gives_up_leaves_no_thread(taken: int) -> None:
    before = threading.active_count()
    ahead = read_ahead(blocks(1_000_000))
    for _ in range(taken):
        next(ahead)
    ahead.close()
    assert threading.active_count() == before
