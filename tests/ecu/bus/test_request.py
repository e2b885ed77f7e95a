"""A request in doubt is not lowered: the table of replayed streams, at the inputs that `step` reads."""

from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import contract_receive_plan
from ecu.bus.request import (
    FIRST,
    HALF_NS,
    LAST,
    REQUEST,
    begin_request,
    hold_request,
    note_request,
    note_rival,
    settle_request,
)
from ecu.bus.sequence import EQUAL, ESTABLISHED, UNKNOWN
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.faults import E2E_REJECTIONS
from ecu.contract.records import FRAME, INPUTS, RecordArray, new_record
from ecu.contract.signals import (
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    INPUT_SIGNALS,
    PEDAL_POSITION,
    PEDAL_PRESSED,
    USABLE,
    VALID,
)
from ecu.jit import kernel

from .conftest import p01_protect

CONTRACT = Path(__file__).parents[3] / "dbc" / "brake_ecu.dbc"
PLAN = contract_receive_plan(CONTRACT)
VEHICLE = contract_transmit_plan(CONTRACT, "Vehicle")
MS = 1_000_000
CYCLE_NS = 10 * MS
T0 = 1_700_000_000_000_000_000
BRAKE_REQUEST, DATA_ID = 0x60, 0x6B01


def request_frames(decel: float, pedal: float = np.nan) -> RecordArray:
    """One frame that asks for these; shape (1,)."""
    values = np.array([signal.low for signal in INPUT_SIGNALS])
    values[[PEDAL_POSITION, PEDAL_PRESSED]] = pedal, float(pedal > 0.0)
    values[[DECEL_DEMAND, DECEL_DEMAND_VALID]] = decel, float(np.isfinite(decel))
    frames = frame_buffer(VEHICLE)
    count = transmit(VEHICLE, new_transmission(VEHICLE), values, 0, frames)
    return frames[:count][frames["can_id"][:count] == BRAKE_REQUEST].copy()


LIVING, RELEASED = request_frames(3.0), request_frames(0.0)
PEDAL, PEDAL_FREE = request_frames(np.nan, 40.0), request_frames(np.nan, 0.0)


@cache
def protected(frame: bytes) -> RecordArray:
    """Return one frame with each of the 15 counters and its checksum; shape (15,)."""
    frames = np.frombuffer(frame * 15, FRAME).copy()
    for counter in range(15):
        p01_protect(frames["data"][counter], 8, DATA_ID, counter)
    return frames


class Wire:
    """Frames with their instants, handed to the ECU cycle by cycle."""

    def __init__(self) -> None:
        self.frames: list[RecordArray] = []

    def send(self, frame: RecordArray, counter: Any, ms: Any) -> None:
        """Send a frame once, or once for each of an array of counters and instants."""
        sent = protected(frame.tobytes())[np.atleast_1d(counter) % 15]
        sent["stamp_ns"] = T0 + (np.asarray(ms) * MS).astype(np.int64)
        self.frames.append(sent)

    def run(self, cycles: int, deadline_ms: float) -> RecordArray:
        """Inputs behind each cycle, the first ends at `deadline_ms`."""
        frames = np.concatenate(self.frames)
        frames = frames[np.argsort(frames["stamp_ns"], kind="stable")]
        kept = np.zeros(cycles, INPUTS)
        ends = T0 + ((10 * np.arange(cycles) + deadline_ms) * MS).astype(np.int64)
        receive_cycles(PLAN, new_reception(PLAN), frames, ends, new_record(INPUTS), kept)
        return kept


@kernel
def receive_cycles(plan: Any, reception: Any, frames: Any, ends: Any, inputs: Any, kept: Any) -> None:
    """Receive in cycles that end at `ends`; keep the inputs of each."""
    first = 0
    for k in range(len(ends)):
        begin_cycle(inputs[0], ends[k], CYCLE_NS)
        first = receive(plan, reception, frames, first, len(frames), inputs[0])
        end_cycle(inputs[0], reception.freshness)
        kept[k] = inputs[0]


def asked(inputs: RecordArray) -> Any:
    """Deceleration that the automated driver asks for in each cycle, 0 where it is not usable."""
    value, verdict = inputs["value"], inputs["verdict"]
    usable = (verdict[:, DECEL_DEMAND] & USABLE == USABLE) & (value[:, DECEL_DEMAND_VALID] > 0.5)
    return np.where(usable, value[:, DECEL_DEMAND], 0.0)


def pressed(inputs: RecordArray) -> Any:
    """Pedal position in each cycle [%], 0 where it is not usable."""
    usable = inputs["verdict"][:, PEDAL_POSITION] & USABLE == USABLE
    return np.where(usable, inputs["value"][:, PEDAL_POSITION], 0.0)


def duel(phase: int, lost: int, offset: float, deadline: float, seed: int, begin: int) -> RecordArray:
    """The sender asks for 3 m/s², beside it a stream of `RELEASED`; 1 ms of jitter each. 400 cycles."""
    wire, k = Wire(), np.arange(400)
    living_ms, replayed_ms = np.random.default_rng(seed).uniform(-1.0, 1.0, (400, 2)).T
    sent, replayed = (k < 60) | (k % 30 >= lost), k >= begin
    wire.send(LIVING, k[sent], (10 * k + living_ms)[sent])
    wire.send(RELEASED, (k + phase)[replayed], (10 * k + offset + replayed_ms)[replayed])
    return wire.run(400, deadline)


@pytest.mark.compiled
@pytest.mark.parametrize("begin", [50, 60])  # before the sender loses frames, and with the first one
@pytest.mark.parametrize("lost", range(6))
@pytest.mark.requirement("REQ-PED-1")
def test_a_replayed_release_never_lowers_the_demand(lost: int, begin: int) -> None:
    """From the second frame on: the very first may come within the sender's own jitter, a cycle before it."""
    for phase, offset in product(range(15), (0.5, 2.0, 3.5, 5.0, 6.5, 8.0, 9.5)):
        if begin == 60 and abs(offset - 10 * (phase == 1)) < 3.6 and phase < 2:
            continue  # in the place of a sender that is silent: it is the sender
        for deadline in (1.5, 9.2):
            inputs = duel(phase, lost, offset, deadline, 100 * phase + lost, begin)
            demand = np.delete(asked(inputs), (0, 1, begin))
            assert demand.min() == pytest.approx(3.0), (phase, offset, deadline)
            reported = inputs["e2e_faults"] == E2E_REJECTIONS
            assert not reported[:begin].any(), (phase, offset, deadline)
            assert reported[begin + 25 :].all(), "reported after a quarter of a second at most"


@pytest.mark.parametrize("phase", range(15))
@pytest.mark.requirement("REQ-PED-3")
def test_a_replayed_braking_is_followed_in_the_senders_own_phase_only(phase: int) -> None:
    """A stream that asks for more can win in the sender's place alone: the safe side of that doubt."""
    wire = Wire()
    for k in range(400):
        wire.send(RELEASED, k, 10 * k)
        if k >= 50:
            wire.send(LIVING, k + phase, 10 * k + 1.0)
    worst = asked(wire.run(400, 4.0)).max()
    assert worst == pytest.approx(3.0 if phase == 0 else 0.0)


@pytest.mark.requirement("REQ-PED-2")
def test_doubt_delays_a_release_by_120_ms_at_most() -> None:
    wire = Wire()
    for k in range(200):
        wire.send(PEDAL if k < 100 else PEDAL_FREE, k, 10 * k)
        if k >= 50:
            wire.send(PEDAL_FREE, k, 10 * k + 1.0)
    inputs = wire.run(200, 4.0)
    position = inputs["value"][:, PEDAL_POSITION]
    released = int(np.argmax(position[100:] == 0.0))
    assert position[:100].tolist() == pytest.approx([40.0] * 100, abs=0.5)
    assert 5 <= released <= 12
    assert inputs["value"][99, PEDAL_PRESSED] == 1.0
    assert inputs["value"][-1, PEDAL_PRESSED] == 0.0


def test_without_doubt_a_release_counts_at_once() -> None:
    wire = Wire()
    for k in range(100):
        wire.send(LIVING if k < 50 else RELEASED, k, 10 * k)
    assert asked(wire.run(100, 1.0)).tolist() == pytest.approx([3.0] * 50 + [0.0] * 50, abs=0.02)


@pytest.mark.requirement("REQ-E2E-4")
def test_a_restarted_sender_is_followed_within_100_ms() -> None:
    for phase in range(15):
        wire = Wire()
        for k in range(100):
            wire.send(RELEASED if k < 50 else LIVING, k if k < 50 else k + phase, 10 * k)
        taken = int(np.argmax(asked(wire.run(100, 1.0))[50:] > 2.9))
        assert taken <= 9, phase
        assert wire.run(100, 1.0)["verdict"][10:, DECEL_DEMAND].min() & USABLE == USABLE, "never lost"


# Frames of the request: instant [ms], pedal [%], switch, deceleration [m/s²] and whether it is vouched for;
# NAN: no valid sample of it
NAN = np.nan
PRESSED, FREE = (40.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
GENTLE, FIRM = (0.0, 0.0, 0.5, 1.0), (0.0, 0.0, 3.0, 1.0)
HELD = [
    ("pressed in this frame", [(0, PRESSED)], PRESSED),
    ("released 59.9 ms later", [(0, PRESSED), (59.9, FREE)], PRESSED),
    ("released 60 ms later", [(0, PRESSED), (60, FREE)], PRESSED),
    ("released 119 ms later", [(0, PRESSED), (119, FREE)], PRESSED),
    ("released 120 ms later", [(0, PRESSED), (120, FREE)], FREE),
    ("released a second later", [(0, PRESSED), (1000, FREE)], FREE),
    ("the clock is set back", [(0, PRESSED), (-10, FREE)], FREE),
    ("two in one instant", [(0, PRESSED), (0, FREE), (60, FREE)], PRESSED),
    ("pressed once more at 60 ms", [(0, PRESSED), (60, PRESSED), (120, FREE)], PRESSED),
    ("an automated driver brakes gently", [(0, GENTLE), (10, FREE)], GENTLE),
    ("… and more firmly", [(0, GENTLE), (10, FIRM), (20, GENTLE)], FIRM),
    ("pedal and automated driver", [(0, PRESSED), (10, FIRM)], (40.0, 1.0, 3.0, 1.0)),
    ("nobody vouches for the deceleration", [(0, (0.0, 0.0, 12.0, 0.0))], FREE),
    ("… nor denies it, nor tells anything else", [(0, (NAN, NAN, 12.0, NAN))], FREE),
]


@pytest.mark.parametrize(("case", "frames", "held"), HELD)
def test_the_largest_of_the_last_60_to_120_ms(case: str, frames: Any, held: Any) -> None:
    state, inputs = np.zeros(1, REQUEST)[0], new_record(INPUTS)[0]
    for ms, samples in frames:
        begin_request(state)
        valid = np.isfinite(samples)
        state["sample"][valid] = np.array(samples)[valid]
        note_request(state, T0 + int(ms * MS), False)
    hold_request(state, inputs)
    assert inputs["value"][FIRST : LAST + 1].tolist() == list(held), case


@pytest.mark.compiled
@pytest.mark.parametrize("rate_hz", [100, 1000])
@pytest.mark.parametrize(
    "sent", [RELEASED, LIVING, PEDAL_FREE, PEDAL], ids=["free", "asked", "pedal free", "pedal"]
)
def test_garbage_that_passes_by_chance_asks_for_nothing(sent: RecordArray, rate_hz: int) -> None:
    """One in 256 has the right checksum, one in 15 of these the next count: the sender alone is heard."""
    seconds, draw = 60, np.random.default_rng(rate_hz)
    wire, k = Wire(), np.arange(100 * seconds)
    wire.send(sent, k, 10 * k)
    garbage = np.zeros(rate_hz * seconds, FRAME)
    garbage["can_id"], garbage["length"] = BRAKE_REQUEST, 8
    garbage["data"][:, :8] = draw.integers(0, 256, (len(garbage), 8))
    garbage["stamp_ns"] = T0 + (1e9 * draw.uniform(1.0, seconds, len(garbage))).astype(np.int64)
    wire.frames.append(garbage)
    beside = wire.run(len(k), 3.0)
    wire.frames.pop()
    alone = wire.run(len(k), 3.0)
    assert np.array_equal(asked(beside), asked(alone))
    assert np.array_equal(pressed(beside), pressed(alone))


# Rival beside the sender: standing, who brakes by pedal (P) or automated (A), is the request valid?
IN_DOUBT = [
    (ESTABLISHED, FREE, FREE, True),
    (ESTABLISHED, PRESSED, FREE, True),
    (ESTABLISHED, PRESSED, PRESSED, True),
    (ESTABLISHED, FIRM, FREE, True),
    (ESTABLISHED, FREE, PRESSED, False),
    (ESTABLISHED, FREE, FIRM, False),
    (ESTABLISHED, FREE, (5.1, 0.0, 0.0, 0.0), False),
    (ESTABLISHED, FREE, (5.0, 0.0, 0.0, 0.0), True),
    (ESTABLISHED, FREE, (0.0, 1.0, 0.0, 0.0), False),
    (ESTABLISHED, FREE, (0.0, 0.5, 0.0, 0.0), True),
    (ESTABLISHED, FREE, (0.0, 0.0, 0.06, 1.0), False),
    (ESTABLISHED, FREE, (0.0, 0.0, 0.05, 1.0), True),
    (ESTABLISHED, FREE, (0.0, 0.0, 12.0, 0.0), True),
    (EQUAL, FREE, PRESSED, True),
    (EQUAL, PRESSED, FREE, True),
    (UNKNOWN, FREE, FREE, True),
    (UNKNOWN, PRESSED, FREE, False),
    (UNKNOWN, FREE, PRESSED, False),
    (UNKNOWN, FIRM, FIRM, False),
]


@pytest.mark.parametrize(("age_ms", "heard"), [(0, True), (120, True), (120.1, False)])
@pytest.mark.parametrize(("standing", "sender", "rival", "valid"), IN_DOUBT)
def test_where_nobody_knows_whether_somebody_brakes_the_request_is_not_valid(
    standing: int, sender: Any, rival: Any, valid: bool, age_ms: float, heard: bool
) -> None:
    state = np.zeros(1, REQUEST)[0]
    reception = new_reception(PLAN)
    reception.freshness["valid"] = 1
    state["sample"] = sender
    note_request(state, T0, False)
    state["sample"] = rival
    note_rival(state, T0, standing)
    settle_request(state, reception.freshness, T0 + int(age_ms * MS))
    asked = reception.freshness["valid"][FIRST : LAST + 1]
    assert asked.tolist() == [int(valid or not heard)] * 4
    assert np.delete(reception.freshness["valid"], range(FIRST, LAST + 1)).all()


def test_without_a_rival_the_request_is_valid() -> None:
    state, reception = np.zeros(1, REQUEST)[0], new_reception(PLAN)
    reception.freshness["valid"] = 1
    state["standing"] = UNKNOWN
    state["sample"] = PRESSED
    note_request(state, 5 * MS, False)
    settle_request(state, reception.freshness, 10 * MS)
    assert reception.freshness["valid"].all()


def pedal(inputs: RecordArray) -> Any:
    """Pedal position [%] in each cycle, NaN where it is not usable."""
    usable = inputs["verdict"][:, PEDAL_POSITION] & USABLE == USABLE
    return np.where(usable, inputs["value"][:, PEDAL_POSITION], np.nan)


class Gap(NamedTuple):
    """A sender that is silent from 2 s on, and a stream that is replayed beside it."""

    silent: int = 0
    """Frames that the sender loses."""
    ahead: int = 0
    """What its counter has jumped by behind them."""
    lead: int = 100
    """Frames that were replayed before; negative: it begins in the gap."""
    jitter: float = 1.0
    """Of the sender [ms]."""

    def drive(self, behind: RecordArray, replayed: RecordArray, phase: int, offset: float) -> Any:
        """Return the pedal in 430 cycles, 2.3 s from the gap on; it is free before."""
        wire, k = Wire(), np.arange(430)
        random = np.random.default_rng(phase)
        living = np.maximum.accumulate(10 * k + random.uniform(-self.jitter, self.jitter, len(k)))
        later = k >= 200 + self.silent
        wire.send(PEDAL_FREE, k[:200], living[:200])
        wire.send(behind, k[later] + self.ahead, living[later])
        later = k >= 200 - self.lead
        second = 10 * k + offset + random.uniform(-1.0, 1.0, len(k))
        wire.send(replayed, k[later] + phase, second[later])
        return pedal(wire.run(len(k), 9.7))

    def phases(self) -> Any:
        """Yield the phases and offsets, two of four in turn, of streams that lie on no grid of the sender."""
        for phase in range(15):
            for offset in (0.5, 6.5) if phase % 2 else (3.5, 9.5):
                away = [(offset - 10 * (phase - ahead)) % 150.0 for ahead in (0, self.ahead)]
                if min(min(a, 150.0 - a) for a in away) > 5.0 + 2.0 * self.jitter:
                    yield phase, offset


SILENT = (0, 5, 7, 10, 20, 50)
LEADS = (150, 50, 0, -2, -5)


def gaps(silent: int, lead: int) -> Iterator[tuple[Gap, int, float]]:
    """Yield gaps with every jump and jitter, each with the phases and offsets of streams beside it."""
    for ahead, jitter in product((0, 3, 8), (1.0, 5.0)):
        gap = Gap(silent, ahead, lead, jitter)
        yield from ((gap, phase, offset) for phase, offset in gap.phases())


@pytest.mark.compiled
@pytest.mark.parametrize("lead", LEADS)
@pytest.mark.parametrize("silent", SILENT)
def test_a_replayed_release_locks_no_pedal_out(silent: int, lead: int) -> None:
    """Behind the gap the driver brakes: within 0.2 s he is followed, or the request is not valid."""
    for gap, phase, offset in gaps(silent, lead):
        position = gap.drive(PEDAL, PEDAL_FREE, phase, offset)[200 + silent + 20 :]
        assert np.nanmin(position, initial=40.0) == pytest.approx(40.0, abs=0.5), (gap, phase, offset)
        if gap.ahead == 0 or lead > 0:  # back on its grid, or beside a stream that is known
            assert np.isfinite(position).all(), (gap, phase, offset)


@pytest.mark.compiled
@pytest.mark.parametrize("lead", LEADS)
@pytest.mark.parametrize("silent", SILENT)
def test_a_replayed_braking_is_followed_while_it_is_alone_and_a_second_longer(silent: int, lead: int) -> None:
    """Known beside the sender before the gap, it is not followed at all."""
    for gap, phase, offset in gaps(silent, lead):
        braked = np.sum(gap.drive(PEDAL_FREE, PEDAL, phase, offset) > 1.0)
        if lead > 0:
            assert braked <= (16 if gap.jitter > 1.0 else 0), (gap, phase, offset)
        elif gap.ahead == 0:
            assert braked <= silent + 17, (gap, phase, offset)
        else:
            assert braked <= silent + 117, (gap, phase, offset)


@pytest.mark.parametrize("phase", [2, 7, 13])
@pytest.mark.parametrize("first", [100, 150, 400])
def test_who_was_there_first_is_the_sender_and_doubt_is_not_valid(first: int, phase: int) -> None:
    """At ignition a replayed release may come first: then the pedal is followed by the hydraulics alone."""
    wire, k = Wire(), np.arange(first + 100)
    wire.send(PEDAL_FREE, k, 10 * k)
    later = k >= first
    wire.send(PEDAL, k[later] + phase, 10 * k[later] + 4.0)
    inputs = wire.run(first + 100, 9.0)
    assert (pedal(inputs)[1 : first + 2] == 0.0).all()
    assert np.isnan(pedal(inputs)[first + 2 :]).all()
    assert (inputs["verdict"][first + 2 :, FIRST : LAST + 1] & VALID == 0).all()


def test_doubt_ends_with_the_rival() -> None:
    wire, k = Wire(), np.arange(200)
    wire.send(PEDAL_FREE, k, 10 * k)
    beside = (k >= 50) & (k < 100)
    wire.send(PEDAL, k[beside] + 7, 10 * k[beside] + 4.0)
    valid = np.isfinite(pedal(wire.run(200, 9.0)))
    assert valid.tolist() == [True] * 52 + [False] * 59 + [True] * 89


def test_places_lie_side_by_side() -> None:
    assert tuple(range(FIRST, LAST + 1)) == (PEDAL_POSITION, PEDAL_PRESSED, DECEL_DEMAND, DECEL_DEMAND_VALID)
    assert HALF_NS == 60 * MS
    assert LIVING.dtype == FRAME
