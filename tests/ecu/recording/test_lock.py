"""Locks between two openings of one file, as between two processes."""

import pytest

from ecu.recording.lock import lock

TAKEN = [
    # first and second lock are shared; the second is refused
    (True, True, False),
    (True, False, True),
    (False, True, True),
    (False, False, True),
]


@pytest.mark.parametrize(("first", "second", "refused"), TAKEN)
def test_only_shared_locks_stand_beside_each_other(
    tmp_path, first: bool, second: bool, refused: bool
) -> None:
    with (tmp_path / "lock").open("a") as one, (tmp_path / "lock").open("a") as other:
        lock(one.fileno(), shared=first)
        if refused:
            with pytest.raises(BlockingIOError):
                lock(other.fileno(), shared=second)
        else:
            lock(other.fileno(), shared=second)


def test_a_lock_ends_with_its_file(tmp_path) -> None:
    with (tmp_path / "lock").open("a") as one:
        lock(one.fileno())
    with (tmp_path / "lock").open("a") as other:
        lock(other.fileno(), wait=True)
