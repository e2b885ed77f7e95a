"""The second daemon: silent beside a living one, speaking 50 ms after it fell silent."""

import json
import random
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.bus.e2e import P01_MODULO
from ecu.bus.output_map import transmit_plan
from ecu.bus.protocol import BusStatus
from ecu.bus.receive_plan import contract_receive_plan
from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.faults import FOREIGN_SENDER
from ecu.contract.records import CYCLE, FRAME, INPUT_WATCH, INPUTS, LEARNED, OUTPUTS, new_record
from ecu.contract.signals import CYCLE_NS, N_OUTPUTS
from ecu.jit import CompileCounter
from ecu.recording import ring as ring_module
from ecu.recording.publish import publish
from ecu.recording.ring import RingReader, create_ring
from ecu.runtime.clock import Grid, TimeSource
from ecu.runtime.cycle import Progress, cycle_once
from ecu.runtime.memory import new_ecu
from ecu.runtime.standby import (
    CLAIM,
    SILENCE_NS,
    claim_is_lost,
    learned_by_first,
    listen,
    new_standby,
)
from ecu.settings.config import load_config, new_params

ROOT = Path(__file__).parents[3]
DBC = ROOT / "dbc" / "brake_ecu.dbc"
OURS = contract_transmit_plan(DBC, "BrakeEcu").ids.tolist()
FINE = BusStatus(False, False, 0, 0)
NOMINAL = np.full(4, 0.45)
MS = 1_000_000


def listened(*heard_ms: int) -> list[int]:
    """Return in which of 40 cycles a standby speaks that hears a frame in the cycles at `heard_ms`."""
    plan = contract_transmit_plan(DBC, "BrakeEcu")
    standby, sent, first = new_standby(waits=True)[0], new_transmission(plan), new_transmission(plan)
    frames, spoken = frame_buffer(plan), []
    for t_ms in range(0, 400, 10):
        count = transmit(plan, first, np.zeros(N_OUTPUTS), 0, frames) if t_ms in heard_ms else 0
        listen(standby, plan, sent, frames, count, t_ms * MS)
        if standby["speaks"]:
            spoken.append(t_ms)
    return spoken


@pytest.mark.parametrize(
    ("heard", "first", "last"),
    [
        (range(0, 100, 10), 140, 390),  # the first one died after its frame at 90 ms
        (range(0, 400, 10), None, None),  # it lives
        ((), None, None),  # there never was one: two that start together would race
        ((0, 40, 80, 120), 170, 390),  # it stumbles by less than 50 ms
        ((0, 390), 50, 380),  # it comes back: silent in the same cycle
    ],
    ids=["dies", "lives", "never heard", "stumbles", "comes back"],
)
@pytest.mark.requirement("REQ-TWO-4")
def test_it_speaks_when_the_first_one_was_silent_for_50_ms(heard, first, last):
    spoken = listened(*heard)
    assert (spoken[:1], spoken[-1:]) == ([first] if first is not None else [], [last] if last else [])


class Wire:
    """One bus for two daemons on one clock; what one sends the other drains."""

    def __init__(self) -> None:
        self.name, self.waiting, self.other = "wire", [], None
        self.sent, self.cut = [], False

    def drain(self, frames, start):
        for i, frame in enumerate(self.waiting):
            frames[start + i] = frame
        count = len(self.waiting)
        self.waiting.clear()
        return count

    def send(self, frames, count):
        self.sent += [(int(frame["can_id"]), int(frame["data"][1] & 0xF)) for frame in frames[:count]]
        if not self.cut:
            self.other.waiting += [frame.copy() for frame in frames[:count]]
        return count

    def status(self):
        return FINE

    def close(self):
        pass


def unit(folder, clock, waits=False):
    """Return what one daemon needs for `cycle_once`."""
    params = new_params(load_config(ROOT / "config" / "suv.toml"))
    ecu = new_ecu(params, None, contract_receive_plan(DBC), contract_transmit_plan(DBC, "BrakeEcu"))
    progress = Progress(ecu, FINE, CompileCounter(), waits=waits)
    return ecu, Wire(), create_ring(folder, {}, b"", slots=64, frames=512), Grid(clock), progress


def test_one_goes_on_counting_where_the_other_stopped(tmp_path):
    now = [0]
    clock = TimeSource(lambda: now[0], lambda: now[0], lambda until_ns: now.__setitem__(0, until_ns))
    first, second = unit(tmp_path / "1", clock), unit(tmp_path / "2", clock, waits=True)
    first[1].other, second[1].other = second[1], first[1]

    def cycle(*units):
        for ecu, wire, ring, grid, progress in units:
            grid.deadline_ns = now[0] // CYCLE_NS * CYCLE_NS
            cycle_once(ecu, wire, ring, grid, progress)
            now[0] -= CYCLE_NS  # both live through the same period
        now[0] += CYCLE_NS

    for _ in range(33):
        cycle(first, second)
    assert second[1].sent == []
    demand = first[1].sent[0][0]
    counters = [counter for can_id, counter in first[1].sent if can_id == demand]
    for _ in range(20):
        cycle(second)
    counters += [counter for can_id, counter in second[1].sent if can_id == demand]
    assert counters == [k % P01_MODULO for k in range(len(counters))]
    assert len(counters) == 33 + 20 - (SILENCE_NS // CYCLE_NS - 1)  # it speaks 50 ms after the last frame
    assert int(second[4].loop["foreign"][0]) == 0
    assert not int(second[0].cycle["bus_faults"][0]) & FOREIGN_SENDER
    before = len(second[1].sent)
    for _ in range(10):
        cycle(first, second)  # it was only held up
    assert len(second[1].sent) == before


@pytest.mark.parametrize("still_cycles", [20, 500])
def test_one_that_stood_still_while_the_standby_spoke_says_nothing_any_more(tmp_path, still_cycles):
    now = [0]
    clock = TimeSource(lambda: now[0], lambda: now[0], lambda until_ns: now.__setitem__(0, until_ns))
    first, second = unit(tmp_path / "1", clock), unit(tmp_path / "2", clock, waits=True)
    first[1].other, second[1].other = second[1], first[1]

    def cycle(number, *units):
        for ecu, wire, ring, grid, progress in units:
            now[0] = number * CYCLE_NS - MS
            cycle_once(ecu, wire, ring, grid, progress)
            for frame in wire.other.waiting:
                frame["stamp_ns"] = frame["stamp_ns"] or now[0]

    for number in range(1, 300):
        cycle(number, first, second)
    said = len(first[1].sent)
    for number in range(300, 300 + still_cycles):
        cycle(number, second)
    assert second[4].speaks
    for number in range(300 + still_cycles, 320 + still_cycles):
        before = len(second[1].sent)
        cycle(number, first, second)
        assert len(second[1].sent) > before
    assert len(first[1].sent) == said
    assert not first[4].speaks


def garbage(draw, count):
    """Frames with identifiers of the ECU and random content."""
    frames = new_record(FRAME, count)
    for frame in frames:
        frame["can_id"], frame["length"] = draw.choice(OURS), 8
        frame["data"][:8] = list(draw.randbytes(8))
    return list(frames)


@pytest.mark.requirement("REQ-TWO-6")
def test_garbage_with_our_identifiers_silences_neither_a_newcomer_nor_a_standby(tmp_path):
    now, draw = [0], random.Random(6)
    clock = TimeSource(lambda: now[0], lambda: now[0], lambda until_ns: now.__setitem__(0, until_ns))
    first, second = unit(tmp_path / "1", clock), unit(tmp_path / "2", clock, waits=True)
    first[1].other, second[1].other = second[1], first[1]

    def cycle(number, *units):
        for ecu, wire, ring, grid, progress in units:
            now[0] = number * CYCLE_NS - MS
            wire.waiting += garbage(draw, 2)
            for frame in wire.waiting:
                frame["stamp_ns"] = now[0]
            cycle_once(ecu, wire, ring, grid, progress)

    for number in range(1, 300):
        before = len(first[1].sent)
        cycle(number, first, second)
        assert len(first[1].sent) > before
    assert second[1].sent == []
    assert int(first[0].cycle["bus_faults"][0]) & FOREIGN_SENDER
    for number in range(300, 400):
        before = len(second[1].sent)
        cycle(number, second)
        assert (len(second[1].sent) > before) == (number >= 304)  # 50 ms after the first one's last frame


def yields_after(foreign, missed=(), cycles=2000):
    """Return in which cycle a daemon yields that hears another one in the cycles `foreign`; None: never.

    Each cycle of `missed` comes after a gap of 0.3 s.
    """
    claim = new_record(CLAIM)[0]
    for cycle in range(cycles):
        if claim_is_lost(claim, int(cycle in foreign), 30 if cycle in missed else 0):
            return cycle
    return None


# cycles in which another sender is heard, cycles after a gap of 0.3 s -> the cycle in which it yields
CLAIMS = {
    "nobody else": ((), (), None),
    "another that began with it": (range(2000), (), 9),
    "another within two seconds": (range(150, 2000), (), 159),
    "another every second cycle": (range(0, 2000, 2), (), None),  # half a sender is none
    "one that came later": (range(210, 2000), (), None),
    "one that came much later": (range(1500, 2000), (), None),
    "what waited while it was held up": ([1000], [1000], None),
    "one that came while it was held up": (range(1000, 2000), [1000], 1009),
    "a standby that falls silent when it hears us": ([1000, 1001], [1000], None),
}


@pytest.mark.parametrize(("foreign", "missed", "cycle"), CLAIMS.values(), ids=CLAIMS)
@pytest.mark.requirement("REQ-TWO-2")
def test_who_spoke_first_goes_on_and_a_newcomer_yields(foreign, missed, cycle):
    assert yields_after(foreign, missed) == cycle


# (periods in which another sender was heard, periods missed) in a cycle after 1000 -> whether it yields in it
HELD_UP = {
    "nobody spoke": ((0, 499), False),
    "a standby took over": ((494, 499), True),
    "a standby took over just now": ((9, 14), False),  # it falls silent at our first frame
    "a standby has spoken for 0.1 s": ((10, 14), True),
    "frames of long ago came in at once": ((20, 0), False),
    "no gap that receivers notice": ((4, 4), False),
}


@pytest.mark.parametrize(("cycle", "yields"), HELD_UP.values(), ids=HELD_UP)
@pytest.mark.requirement("REQ-TWO-2")
def test_one_that_stood_still_while_another_spoke_yields_at_once(cycle, yields):
    claim = new_record(CLAIM)[0]
    assert not any(claim_is_lost(claim, 0, 0) for _ in range(1000))
    assert claim_is_lost(claim, *cycle) == yields


@pytest.mark.parametrize("apart", [0, 1, 7, 50])
@pytest.mark.requirement("REQ-TWO-5")
def test_of_two_that_began_together_one_speaks_before_long(tmp_path, apart):
    """Eight seeds of the draw; `apart`: cycles between their starts."""
    longest = 0
    for seed in range(8):
        random.seed(seed)
        now = [0]
        clock = TimeSource(
            lambda now=now: now[0], lambda now=now: now[0], lambda until, now=now: now.__setitem__(0, until)
        )
        units = [unit(tmp_path / f"{seed}.{name}", clock) for name in (1, 2)]
        units[0][1].other, units[1][1].other = units[1][1], units[0][1]
        silence, spoke = 0, []
        for cycle in range(apart + 150):
            before = [len(one[1].sent) for one in units]
            for ecu, wire, ring, grid, progress in units if cycle >= apart else units[:1]:
                now[0] = grid.deadline_ns = cycle * CYCLE_NS  # both live through the same period
                cycle_once(ecu, wire, ring, grid, progress)
            spoke.append(sum(len(one[1].sent) > count for one, count in zip(units, before, strict=True)))
            silence = 0 if spoke[-1] else silence + 1
            longest = max(longest, silence)
        assert set(spoke[-60:]) == {1}, seed
    assert longest <= 21  # 50 ms, and at most 150 ms drawn


DESCRIPTION = {"interface": "socketcan", "channel": "can0", "store_key": "suv/1", "state": {"itemsize": 8}}


@pytest.fixture
def first_ring(tmp_path, monkeypatch):
    """Return a ring of this process into which what was learned can be published."""
    monkeypatch.setattr(ring_module, "ring_folder", lambda: tmp_path)
    ring = create_ring(ring_module.ring_path(1), DESCRIPTION, b"", slots=8, frames=8)

    def learned(mu_b, cycles=3):
        record = new_record(LEARNED)
        record["mu_b"], record["sigma_mu_b"], record["observed_s"] = mu_b, 0.01, 5.0
        record["radius_sigma"] = 0.001
        for number in range(cycles):
            cycle = new_record(CYCLE)
            cycle["number"] = number
            measured = (new_record(kind) for kind in (OUTPUTS, INPUTS, ESTIMATE))
            publish(ring, cycle, *measured, record, new_record(INPUT_WATCH), new_record(FRAME))
        return ring

    return learned


@pytest.mark.parametrize(
    ("mu_b", "description", "found"),
    [
        (0.40, DESCRIPTION, True),
        (0.10, DESCRIPTION, False),  # no lining has that
        (0.40, {**DESCRIPTION, "channel": "can1"}, False),
        (0.40, {**DESCRIPTION, "store_key": "lcv/1"}, False),
        (0.40, {**DESCRIPTION, "state": {"itemsize": 9}}, False),
    ],
    ids=["same car and bus", "out of range", "another bus", "another car", "another version"],
)
def test_what_the_first_one_learned_comes_out_of_its_ring(first_ring, mu_b, description, found):
    first_ring(mu_b)
    learned = learned_by_first(json.loads(json.dumps(description)), NOMINAL)
    assert (learned is not None) == found
    if learned is not None:
        assert learned["mu_b"][0].tolist() == [mu_b] * 4


def test_before_its_first_cycle_a_ring_tells_nothing(first_ring):
    ring = first_ring(0.4, cycles=0)
    assert RingReader(ring.path).latest("learned") is None
    assert learned_by_first(DESCRIPTION, NOMINAL) is None


def test_a_standby_counts_on_in_the_messages_of_a_map(tmp_path):
    (tmp_path / "car.dbc").write_text(
        'VERSION ""\nBU_: A\nBO_ 10 Wheels: 8 A\n SG_ v : 0|16@1+ (1,0) [0|0] "rad/s" A\n'
        'BO_ 20 Front: 8 A\n SG_ p : 0|16@1+ (1,0) [0|0] "bar" A\n SG_ n : 23|3@0+ (1,0) [0|0] "" A\n'
        'BO_ 21 Rear: 8 A\n SG_ p : 0|16@1+ (1,0) [0|0] "bar" A\n'
    )
    (tmp_path / "car.toml").write_text(
        'database = "car.dbc"\n[messages]\nWheels = { period = 0.01 }\n'
        'Front = { period = 0.01, checksum = "toyota", counter = { signal = "n", modulo = 7 } }\n'
        'Rear = { period = 0.01, checksum = "hyundai_sum" }\n'
        '[inputs]\nwheel_speed_fl = { message = "Wheels", signal = "v" }\n'
        '[outputs]\npressure_demand_fl = { message = "Front", signal = "p", invalid = 0 }\n'
        'pressure_demand_rl = { message = "Rear", signal = "p", invalid = 0 }\n'
    )
    plan = transmit_plan(tmp_path / "car.toml", receive_plan(tmp_path / "car.toml"))
    first, second, standby = new_transmission(plan), new_transmission(plan), new_standby(waits=True)[0]
    frames = frame_buffer(plan)
    for cycle in range(20):
        count = transmit(plan, first, np.zeros(N_OUTPUTS), cycle, frames)
        listen(standby, plan, second, frames, count, cycle * CYCLE_NS)
        assert second.counter.tolist() == first.counter.tolist() == [(cycle + 1) % 7, 0]
    listen(standby, plan, second, frames, 0, 20 * CYCLE_NS + SILENCE_NS)
    assert standby["speaks"]
