import numpy as np
import pytest

from brakelab.bench import watchers
from brakelab.bench.watchers import Block, Watchers, alternate, inside

BLOCKS = [Block(100, 200, False), Block(250, 350, True), Block(400, 500, False)]


def test_cycles_between_two_blocks_count_for_neither():
    t_ns = np.array([99, 100, 199, 200, 249, 250, 349, 350, 400, 500])
    assert t_ns[inside(BLOCKS, t_ns, False)].tolist() == [100, 199, 400]
    assert t_ns[inside(BLOCKS, t_ns, True)].tolist() == [250, 349]


class Clock:
    """Stands in for `time`: moves on by what is slept, and by `late_ns` that a busy machine adds."""

    def __init__(self, late_ns):
        self.now_ns, self.late_ns = 0, late_ns

    def sleep(self, s):
        self.now_ns += round(1e9 * s) + self.late_ns

    def monotonic_ns(self):
        return self.now_ns

    def monotonic(self):
        return self.now_ns * 1e-9


@pytest.mark.parametrize(
    ("seconds", "late_s", "blocks"),
    [
        (20.0, 0.0, [(0.5, 5), (5.5, 10), (10.5, 15), (15.5, 20)]),
        (12.0, 0.0, [(0.5, 5), (5.5, 10), (10.5, 12)]),
        (12.0, 3.0, [(0.5, 8), (8.5, 15)]),
    ],
    ids=["whole blocks", "the last is cut", "a machine that wakes late"],
)
def test_it_begins_without_and_takes_turns(monkeypatch, seconds, late_s, blocks):
    monkeypatch.setattr(watchers, "time", Clock(round(1e9 * late_s)))
    calls = []

    class Calls:
        run = staticmethod(calls.append)

    found = alternate(Calls(), seconds, lambda: True)
    assert calls == [bool(i % 2) for i in range(len(blocks))] == [block.watched for block in found]
    edges_s = np.array([(block.begin_ns, block.end_ns) for block in found]) * 1e-9
    np.testing.assert_allclose(edges_s, blocks)


def test_a_run_that_ended_takes_no_more_turns(monkeypatch):
    monkeypatch.setattr(watchers, "time", Clock(0))
    goes_on = iter([True, True, False])

    class Calls:
        run = staticmethod(lambda on: None)

    assert len(alternate(Calls(), 60.0, lambda: next(goes_on))) == 2


def test_messages_a_second_of_being_watched():
    one = Watchers.__new__(Watchers)
    one._messages = 2 * 25 * 10
    watched = Block(0, 9_500_000_000, True)
    assert one.messages_a_second([watched, Block(0, 10**10, False)]) == 25
