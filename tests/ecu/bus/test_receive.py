"""Frames to inputs: what is taken, what is rejected, and that a rejected frame changes nothing it carries."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from ecu.bus.database import load_database
from ecu.bus.freshness import begin_cycle, end_cycle, new_freshness
from ecu.bus.plan import SignalUse
from ecu.bus.receive import EXTENDED_ID, new_reception, receive
from ecu.bus.receive_plan import MessageUse, compile_receive, contract_receive_plan, places_of
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import (
    FRAME,
    FRAME_ERROR,
    FRAME_EXTENDED,
    FRAME_REMOTE,
    INPUTS,
    RecordArray,
    new_record,
)
from ecu.contract.signals import ALIVE, INPUT, INPUT_SIGNALS, N_INPUTS, RATE_OK, USABLE, VALID
from ecu.jit import Kernel

from .conftest import p01_protect

ROOT = Path(__file__).parents[3]
CONTRACT = ROOT / "dbc" / "brake_ecu.dbc"
PLAN = contract_receive_plan(CONTRACT)
VEHICLE = contract_transmit_plan(CONTRACT, "Vehicle")
NAMES = [str(name) for name in PLAN.messages["name"]]
CYCLE_NS = 10_000_000
T0 = 1_700_000_000_000_000_000
SPEED = INPUT["wheel_speed_fl"]


class Bus:
    """A vehicle that sends every cycle, 1 ms before the deadline, and the ECU that receives."""

    def __init__(self) -> None:
        self.inputs, self.reception = new_record(INPUTS), new_reception(PLAN)
        self.transmission = new_transmission(VEHICLE)
        self.values = np.array([signal.low + 0.25 * (signal.high - signal.low) for signal in INPUT_SIGNALS])
        self.cycle = 0

    def sent(self) -> RecordArray:
        """Frames of this cycle, as sent."""
        frames = frame_buffer(VEHICLE)
        count = transmit(VEHICLE, self.transmission, self.values, self.cycle, frames)
        frames["stamp_ns"] = T0 + self.cycle * CYCLE_NS - 1_000_000
        return frames[:count]

    def take(self, frames: RecordArray) -> int:
        """Receive frames as this cycle's; index of the first one left."""
        inputs: Any = self.inputs[0]
        begin_cycle(inputs, T0 + self.cycle * CYCLE_NS, CYCLE_NS)
        left = receive(PLAN, self.reception, frames, 0, len(frames), inputs)
        end_cycle(inputs, self.reception.freshness)
        self.cycle += 1
        return int(left)

    def run(self, cycles: int) -> None:
        for _ in range(cycles):
            self.take(self.sent())

    def counts(self, message: str = "WheelSpeedFront") -> dict[str, int]:
        record = self.reception.messages[NAMES.index(message)]
        return {
            name: int(record[name]) for name in record.dtype.names if "errors" in name and record[name]
        } | {name: int(record[name]) for name in ("received", "accepted")}

    def verdict(self, place: int = SPEED) -> int:
        return int(self.inputs["verdict"][0, place])


def only(frames: RecordArray, can_id: int) -> RecordArray:
    return frames[frames["can_id"] == can_id]


def test_every_input_that_has_a_message_comes_alive_in_time() -> None:
    bus = Bus()
    bus.run(220)
    for place, signal in enumerate(INPUT_SIGNALS):
        expected = ALIVE | RATE_OK | VALID if signal.message else 0
        assert bus.verdict(place) == expected, signal.name
    assert PLAN.mapped.astype(bool).tolist() == [bool(signal.message) for signal in INPUT_SIGNALS]


def test_frames_after_the_deadline_wait() -> None:
    bus = Bus()
    frames = bus.sent()
    frames["stamp_ns"][3:] = T0 + 1
    assert bus.take(frames) == 3
    assert bus.take(frames[3:]) == len(frames) - 3


def test_identifiers_of_29_bits_are_found_wherever_they_stand() -> None:
    """The same bus with all identifiers of 29 bits: each message is found, and no other taken for it."""
    bus = Bus()
    ids = PLAN.ids | np.uint32(EXTENDED_ID)
    plan, frames = PLAN._replace(ids=ids, places=places_of(ids)), bus.sent()
    frames["flags"] |= FRAME_EXTENDED
    strangers = frames.copy()
    strangers["can_id"] += 0x10000
    begin_cycle(bus.inputs[0], T0, CYCLE_NS)
    receive(plan, bus.reception, np.concatenate([frames, strangers]), 0, 2 * len(frames), bus.inputs[0])
    accepted = bus.reception.messages["accepted"]
    assert set(PLAN.ids[accepted > 0]) == set(frames["can_id"])
    assert bus.reception.totals["unknown"][0] == len(frames)


def test_filters_let_through_what_the_plan_knows() -> None:
    assert set(VEHICLE.ids) <= set(PLAN.ids)
    assert list(PLAN.ids) == sorted(PLAN.ids)
    assert len(PLAN.ids) == 25


def broken(frames: RecordArray, what: str) -> RecordArray:
    frames = frames.copy()
    frame = frames[frames["can_id"] == 0x70]
    if what == "payload bit":
        frame["data"][0, 4] ^= 0x20
    elif what == "checksum":
        frame["data"][0, 0] ^= 0x01
    elif what == "shortened":
        frame["length"] = 7
    elif what == "another frame's data":
        frame["data"] = frames[frames["can_id"] == 0x71]["data"]
    elif what == "stuck counter":
        p01_protect(frame["data"][0], 8, 0x7C01, 14)
    elif what == "counter 15":
        p01_protect(frame["data"][0], 8, 0x7C01, 15)
    frames[frames["can_id"] == 0x70] = frame
    return frames


@pytest.mark.parametrize(
    ("what", "counter"),
    [
        ("payload bit", "checksum_errors"),
        ("checksum", "checksum_errors"),
        ("another frame's data", "checksum_errors"),
        ("shortened", "length_errors"),
        ("counter 15", "sequence_errors"),
    ],
)
@pytest.mark.requirement("REQ-E2E-2")
def test_a_rejected_frame_changes_nothing_it_carries(what: str, counter: str) -> None:
    bus = Bus()
    bus.run(30)
    before = bus.inputs["value"].copy(), bus.reception.freshness[SPEED].copy()
    bus.values[SPEED] = 99.0
    bus.take(broken(bus.sent(), what))
    assert bus.inputs["new"][0, SPEED] == 0
    assert bus.inputs["value"][0, SPEED] == before[0][0, SPEED]
    assert bus.reception.freshness[SPEED] == before[1]
    assert bus.inputs["new"][0, INPUT["wheel_speed_rl"]] == 1
    assert bus.counts() == {"received": 31, "accepted": 30, counter: 1}
    assert bus.reception.totals["rejected"] == 1
    bus.run(1)
    assert bus.inputs["value"][0, SPEED] == pytest.approx(99.0)


def test_a_stuck_counter_is_never_taken_twice() -> None:
    bus = Bus()
    bus.run(15)  # the last counter is 14
    for _ in range(50):
        bus.take(broken(bus.sent(), "stuck counter"))
    assert bus.counts() == {"received": 65, "accepted": 15}
    assert bus.reception.messages[NAMES.index("WheelSpeedFront")]["repeated"] == 50
    assert bus.verdict() & ALIVE == 0
    assert bus.verdict(INPUT["wheel_speed_rl"]) & USABLE == USABLE


# what happens to one frame of a stream -> what is counted: late, gaps, repeated, wrong
TROUBLES = {
    "nothing": (None, (0, 0, 0, 0)),
    "lost": ("lost", (0, 1, 0, 0)),
    "late": ("late", (1, 0, 0, 0)),
    "sent twice": ("twice", (0, 0, 1, 0)),
    "a bit spoilt": ("payload bit", (0, 1, 0, 1)),
    "a byte short": ("shortened", (0, 1, 0, 1)),
    "another's count": ("another", (0, 0, 0, 1)),
}


@pytest.mark.parametrize(("what", "counted"), TROUBLES.values(), ids=TROUBLES)
def test_late_lost_repeated_and_wrong_are_counted_apart(what: str | None, counted: tuple[int, ...]) -> None:
    bus = Bus()
    bus.run(30)
    frames = bus.sent()
    ours = frames["can_id"] == 0x70
    if what == "lost":
        frames = frames[~ours]
    elif what == "late":
        held, frames = frames[ours].copy(), frames[~ours]
        bus.take(frames)
        frames = np.concatenate([held, bus.sent()])
        frames["stamp_ns"][0] = frames["stamp_ns"][1]
    elif what == "twice":
        frames = np.concatenate([frames, frames[ours]])
    elif what == "another":
        other = frames[ours].copy()
        p01_protect(other["data"][0], 8, 0x7C01, (int(other["data"][0, 1] & 0xF) + 7) % 15)
        other["stamp_ns"] -= 4_000_000
        frames = np.concatenate([other, frames])
    elif what is not None:
        frames = broken(frames, what)
    bus.take(frames)
    bus.run(20)
    assert tuple(bus.reception.totals["e2e"][0].tolist()) == counted


def beside(frames: RecordArray, can_id: int, ms: float, counts: int = 0, other: bool = True) -> RecordArray:
    """Return the frames and a second one of a message `ms` later: another content, `counts` counts on."""
    second = frames[frames["can_id"] == can_id].copy()
    if other:
        second["data"][0, 4] ^= 0x20
    data_id = int(VEHICLE.messages["data_id"][VEHICLE.ids == can_id][0])
    p01_protect(second["data"][0], 8, data_id, (int(second["data"][0, 1] & 0xF) + counts) % 15)
    second["stamp_ns"] += int(ms * 1_000_000)
    together = np.concatenate([frames, second])
    return together[np.argsort(together["stamp_ns"], kind="stable")]


def garbage(frames: RecordArray, can_id: int) -> RecordArray:
    """Return the frames and nine times as many of one message with a wrong checksum."""
    ours = frames[frames["can_id"] == can_id]
    spoilt = np.repeat(ours, 9)
    spoilt["data"][:, 0] ^= 1
    return np.concatenate([frames, spoilt])


# what comes in each cycle of a second -> whether nothing is learned for it
UNSURE = {
    "the sender alone": (lambda frames: frames, False),
    "each frame twice": (lambda frames: beside(frames, 0x70, 0.0, other=False), False),
    "each frame again after 4 ms": (lambda frames: beside(frames, 0x70, 4.0, other=False), False),
    "another content with its count": (lambda frames: beside(frames, 0x70, 2.0), True),
    "another content beside it": (lambda frames: beside(frames, 0x70, 2.0, counts=7), False),
    "every frame spoilt": (lambda frames: broken(frames, "checksum"), True),
    "nine of ten spoilt": (lambda frames: garbage(frames, 0x70), True),
    "another request with its count": (lambda frames: beside(frames, 0x60, 2.0), False),
    "another one beside it, which is the request's own affair": (
        lambda frames: beside(frames, 0x60, 2.0, counts=7),
        False,
    ),
}


@pytest.mark.parametrize(("what", "unsure"), UNSURE.values(), ids=UNSURE)
def test_what_is_surely_its_sender_s_is_learned_from(what: Any, unsure: bool) -> None:
    bus = Bus()

    def run(cycles: int, what: Any = lambda frames: frames) -> bool:
        for _ in range(cycles):
            frames = what(bus.sent())
            frames["stamp_ns"] -= 5_000_000
            bus.take(frames)
        return bool(bus.inputs["e2e_unsure"][0])

    assert not run(30)
    assert run(100, what) is unsure
    assert run(99) is unsure, "reported for a second"
    assert not run(20)


@pytest.mark.compiled
def test_five_percent_corrupted() -> None:
    bus, random = Bus(), np.random.default_rng(1)
    spoilt = 0
    for _ in range(2000):
        frames = bus.sent()
        for frame in frames:
            if random.random() < 0.05 and frame["can_id"] != 0x410:  # Ambient has no checksum
                frame["data"][random.integers(8)] ^= 1 << random.integers(8)
                spoilt += 1
        bus.take(frames)
        if bus.cycle > 1:
            assert bus.verdict() & USABLE == USABLE
    counters = bus.reception.messages
    assert counters["checksum_errors"].sum() == spoilt
    assert bus.reception.totals["rejected"] == spoilt, "a corrupted frame costs no other one"


def test_a_gap_of_a_second() -> None:
    bus = Bus()
    bus.run(50)
    bus.cycle += 100  # nobody looks
    bus.transmission.counter[:] = (bus.transmission.counter + 100) % 15
    bus.take(bus.sent())
    assert bus.inputs["new"][0, SPEED] == 1
    bus.run(1)
    assert bus.verdict() == ALIVE | RATE_OK | VALID


def test_silence_of_200_ms_is_noticed_and_ends() -> None:
    bus = Bus()
    bus.run(50)
    for cycle in range(20):
        frames = bus.sent()
        bus.take(frames[frames["can_id"] != 0x70])
        assert bool(bus.verdict() & ALIVE) == (cycle < 9), cycle
    bus.run(1)
    assert bus.verdict() & USABLE == USABLE


@pytest.mark.parametrize("pause", [0, 1, 5, 100])
@pytest.mark.parametrize("before", range(45, 60))
def test_a_sender_that_restarts_is_accepted_again(before: int, pause: int) -> None:
    bus = Bus()
    bus.run(before)
    bus.cycle += pause
    bus.transmission.counter[:] = 0
    bus.run(9)  # six while the one before may live, the next may repeat its last counter
    assert bus.inputs["new"][0, SPEED] == 1


@pytest.mark.requirement("REQ-E2E-3")
def test_a_block_replayed_beside_the_sender_is_not_accepted() -> None:
    """20 old cycles come again, each 3 ms after the true one; the true frames go on being taken."""
    bus = Bus()
    record = []
    for _ in range(40):
        record.append(bus.sent())
        bus.take(record[-1])
    bus.values[SPEED] = 77.0
    for old in record[12:32]:  # their counters are 7 behind
        now = bus.sent()
        again = only(old, 0x70).copy()
        again["stamp_ns"] = now["stamp_ns"][0] + 500_000
        bus.take(np.concatenate([now, again]))
        assert bus.inputs["value"][0, SPEED] == pytest.approx(77.0)
    assert bus.counts() == {"received": 80, "accepted": 60, "sequence_errors": 20}


def test_a_block_replayed_in_a_burst_is_not_accepted() -> None:
    bus = Bus()
    record = []
    for _ in range(40):
        record.append(bus.sent())
        bus.take(record[-1])
    burst = np.concatenate([only(old, 0x70) for old in record[13:33]])
    burst["stamp_ns"] = T0 + (bus.cycle - 1) * CYCLE_NS + np.arange(20) * 250_000
    bus.take(burst)
    assert bus.counts()["accepted"] <= 42, "two may fit the sequence by chance"
    bus.run(9)  # the burst came instead of a cycle: the sender is one count behind its grid
    assert bus.inputs["new"][0, SPEED] == 1


@pytest.mark.parametrize(
    ("flags", "total"),
    [(FRAME_ERROR, "bus_errors"), (FRAME_REMOTE, "bus_errors"), (FRAME_EXTENDED, "unknown")],
)
def test_what_is_no_data_frame_of_ours(flags: int, total: str) -> None:
    bus = Bus()
    frames = only(bus.sent(), 0x70).copy()
    frames["flags"] = flags
    bus.take(frames)
    assert bus.inputs["new"].sum() == 0
    assert {name: int(bus.reception.totals[name][0]) for name in ("frames", total)} == {"frames": 1, total: 1}


def test_unknown_identifiers_and_a_foreign_sender(frame: Callable[..., RecordArray]) -> None:
    bus = Bus()
    bus.take(np.concatenate([frame(T0 - 2, 0x123, b"\1\2"), frame(T0 - 1, 0x50, bytes(8))]))
    totals = bus.reception.totals[0]
    assert (totals["frames"], totals["unknown"], totals["foreign"], totals["rejected"]) == (2, 1, 1, 0)
    assert bus.counts("PressureDemandFront")["received"] == 1


def test_not_available_and_error_codes() -> None:
    bus = Bus()
    bus.run(3)
    bus.values[SPEED] = np.nan
    bus.take(bus.sent())
    assert (bus.inputs["new"][0, SPEED], bus.verdict() & VALID, bus.verdict() & ALIVE) == (0, 0, ALIVE)
    assert bus.inputs["new"][0, SPEED + 1] == 1
    frames = only(bus.sent(), 0x60)
    frames["data"][0, 1] = frames["data"][0, 1] & 0xCF | 0x20  # pedal_pressed: 2, error
    p01_protect(frames["data"][0], 8, 0x6B01, int(frames["data"][0, 1]) & 0xF)
    bus.take(frames)
    assert bus.inputs["new"][0, INPUT["pedal_pressed"]] == 0
    assert bus.inputs["new"][0, INPUT["pedal_position"]] == 1


def test_vehicle_speed_may_come_every_10_to_100_ms() -> None:
    for every in (1, 4, 10):
        bus = Bus()
        place = INPUT["vehicle_speed"]
        for cycle in range(100):
            bus.values[[place, place + 1]] = 10.0 if cycle % every == 0 else np.nan
            bus.values[place + 1] /= 10.0
            bus.run(1)
        assert bus.verdict(place) == ALIVE | RATE_OK | VALID, every


def test_a_log_may_start_anywhere() -> None:
    bus = Bus()
    bus.transmission.counter[:] = 9
    bus.run(1)
    assert bus.inputs["new"][0, SPEED] == 1


@pytest.mark.compiled
@pytest.mark.skipif(isinstance(receive, Kernel), reason="of a library: numba counts nothing there")
def test_kernels_allocate_nothing_but_a_handle_per_array_argument() -> None:
    bus = Bus()
    bus.run(3)
    inputs: Any = bus.inputs[0]
    frames, buffer = bus.sent(), frame_buffer(VEHICLE)

    def cycles(numbers: Iterable[int]) -> None:
        for cycle in numbers:
            begin_cycle(inputs, T0 + cycle * CYCLE_NS, CYCLE_NS)
            receive(PLAN, bus.reception, frames, 0, len(frames), inputs)
            end_cycle(inputs, bus.reception.freshness)
            transmit(VEHICLE, bus.transmission, bus.values, cycle, buffer)

    cycles(range(3))
    _nrt_python.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    cycles(range(100))
    after = rtsys.get_allocation_stats()
    arguments = len(PLAN) + len(bus.reception) + 1 + 1 + len(VEHICLE) + len(bus.transmission) + 2
    assert after.alloc - before.alloc == 100 * arguments
    assert after.free - before.free == 100 * arguments


def test_extended_identifiers_are_not_mixed_up_with_standard_ones() -> None:
    assert EXTENDED_ID == 0x8000_0000
    assert not any(PLAN.ids & EXTENDED_ID)
    assert len(PLAN.expected) == N_INPUTS


def test_of_a_multiplexed_message_comes_what_its_multiplexer_says(tmp_path: Path) -> None:
    path = tmp_path / "car.dbc"
    path.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 1 M: 3 A\n SG_ which M : 0|8@1+ (1,0) [0|0] "" A\n'
        ' SG_ one m1 : 8|8@1+ (1,0) [0|0] "" A\n SG_ two m2 : 16|8@1+ (1,0) [0|0] "" A\n'
    )
    message = load_database(path).messages[0]
    use = MessageUse(message, [SignalUse("one", 0), SignalUse("two", 1)], 0.01, 0.01)
    places = np.ones(N_INPUTS)  # as many as the library's kernel has
    fresh = new_freshness(0.1 * places, 0.01 * places, 0.01 * places, 0.0 * places, 255.0 * places)
    plan = compile_receive([use], fresh)
    for which, new in ((1, [1, 0]), (2, [0, 1]), (3, [0, 0])):
        inputs, frames = new_record(INPUTS), new_record(FRAME)
        frames["can_id"], frames["length"], frames["data"][0, :3] = 1, 3, [which, 10, 20]
        begin_cycle(inputs[0], 0, CYCLE_NS)
        receive(plan, new_reception(plan), frames, 0, 1, inputs[0])
        assert inputs["new"][0, :2].tolist() == new
        assert inputs["value"][0, :2].tolist() == [10.0 * new[0], 20.0 * new[1]]
