import itertools

import numpy as np

from brakelab.bench import watchers
from brakelab.bench.watchers import Block, Watchers, alternate, inside

BLOCKS = [Block(100, 200, False), Block(250, 350, True), Block(400, 500, False)]


def test_cycles_between_two_blocks_count_for_neither():
    t_ns = np.array([99, 100, 199, 200, 249, 250, 349, 350, 400, 500])
    assert t_ns[inside(BLOCKS, t_ns, False)].tolist() == [100, 199, 400]
    assert t_ns[inside(BLOCKS, t_ns, True)].tolist() == [250, 349]


def test_it_begins_without_and_takes_turns(monkeypatch):
    monkeypatch.setattr(watchers, "BLOCK_S", 0.02)
    monkeypatch.setattr(watchers, "AFTER_CHANGE_S", 0.005)
    told = []

    class Told:
        run = staticmethod(told.append)

    blocks = alternate(Told(), 0.1, lambda: len(told) < 4)
    assert told == [False, True, False, True] == [block.watched for block in blocks]
    assert all(0.01e9 < block.end_ns - block.begin_ns < 0.1e9 for block in blocks)
    assert all(a.end_ns <= b.begin_ns - 5_000_000 for a, b in itertools.pairwise(blocks))


def test_messages_a_second_of_being_watched():
    one = Watchers.__new__(Watchers)
    one._messages = 2 * 25 * 10
    watched = Block(0, 9_500_000_000, True)
    assert one.messages_a_second([watched, Block(0, 10**10, False)]) == 25
