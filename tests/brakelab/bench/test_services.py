import numpy as np
import pytest

from brakelab.bench import services
from brakelab.bench.services import NOTHING, Block, alternate, inside, seconds_beside

BLOCKS = [Block(100, 200, NOTHING), Block(250, 350, "watch"), Block(400, 500, NOTHING)]


def test_cycles_between_two_blocks_count_for_neither():
    t_ns = np.array([99, 100, 199, 200, 249, 250, 349, 350, 400, 500])
    assert t_ns[inside(BLOCKS, t_ns, NOTHING)].tolist() == [100, 199, 400]
    assert t_ns[inside(BLOCKS, t_ns, "watch")].tolist() == [250, 349]
    assert seconds_beside(BLOCKS, NOTHING) == pytest.approx(2 * (0.5 + 1e-7))


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
def test_each_service_has_its_turn_after_nothing(monkeypatch, seconds, late_s, blocks):
    monkeypatch.setattr(services, "time", Clock(round(1e9 * late_s)))
    calls = []

    class Calls:
        def __init__(self, name):
            self.name = name

        def run(self, on):
            calls.append((self.name, on))

    found = alternate({"watch": Calls("watch"), "XCP": Calls("XCP")}, seconds, lambda: True)
    turns = [NOTHING, "watch", "XCP", NOTHING][: len(blocks)]
    assert [block.beside for block in found] == turns
    assert calls[:2] == [("watch", False), ("XCP", False)]
    assert calls[2:] == [(turn, on) for turn in turns if turn != NOTHING for on in (True, False)]
    edges_s = np.array([(block.begin_ns, block.end_ns) for block in found]) * 1e-9
    np.testing.assert_allclose(edges_s, blocks)


def test_a_run_that_ended_takes_no_more_turns(monkeypatch):
    monkeypatch.setattr(services, "time", Clock(0))
    goes_on = iter([True, True, False])
    assert len(alternate({}, 60.0, lambda: next(goes_on))) == 2
