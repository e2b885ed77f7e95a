"""`brake-ecu play`: every frame on schedule, as it was or as contract frames with fresh E2E."""

from functools import partial
from pathlib import Path

import can
import numpy as np
import pytest

from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.rig.play import command as player
from brakelab.rig.play.command import INTERRUPTED, Sent, Waker, play, send_on_schedule
from brakelab.rig.play.play_log import contract_frames, raw_frames, timed, timed_frames
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.protocol import BusStatus
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import contract_receive_plan
from ecu.contract.records import FRAME, INPUTS, RecordArray, new_record
from ecu.contract.signals import ACCEL_X, CYCLE_NS, STEERING_ANGLE, USABLE, WHEEL_SPEED
from ecu.errors import UserError
from ecu.runtime.clock import TimeSource
from ecu.settings.resources import resource

MS, US = 1_000_000, 1000


@pytest.fixture(autouse=True)
def no_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process that runs the tests stays an ordinary one."""
    monkeypatch.setattr(player, "ask_for_priority", lambda: "")


class Bus:
    """Notes when it was given what; refuses the frames of identifier 0."""

    name = "test"

    def __init__(self, source: TimeSource) -> None:
        self.source = source
        self.sent: list[tuple[int, int]] = []

    def drain(self, frames: RecordArray, start: int) -> int:
        return 0

    def send(self, frames: RecordArray, count: int) -> int:
        assert len(frames) == count
        now = self.source.monotonic_ns()
        self.sent += [(now, can_id) for can_id in frames["can_id"].tolist()]
        return int(np.count_nonzero(frames["can_id"]))

    def status(self) -> BusStatus:
        return BusStatus(False, False, 0, 0)

    def close(self) -> None:
        pass


class Clock:
    """Goes on by a microsecond whenever it is read; wakes sleepers `late_ns` after what they asked for."""

    def __init__(self, late_ns: int = 0) -> None:
        self.now, self.late_ns, self.slept = 5_000 * MS, late_ns, 0
        self.source = TimeSource(self.read, self.read, self.sleep_until)

    def read(self) -> int:
        self.now += US
        return self.now

    def sleep_until(self, deadline_ns: int) -> None:
        begin = self.now
        self.now = max(self.now, deadline_ns) + self.late_ns
        self.slept += self.now - begin


# stamps of the log [ms] -> when the frames are due at normal speed [ms after the first]
STAMPS = {
    "regular": ([100, 110, 120], [0, 10, 20]),
    "the same stamp": ([100, 100, 110], [0, 0, 10]),
    "a gap is kept": ([100, 110, 60_110, 60_120], [0, 10, 60_010, 60_020]),
    "two frames changed places": ([100, 120, 119, 130], [0, 20, 20, 30]),
    "late by 100 ms": ([1000, 1100, 1000, 1110], [0, 100, 100, 110]),
    "Unix time": ([1_600_000_000_000, 1_600_000_000_001], [0, 1]),
}


@pytest.mark.parametrize("speed", [0.1, 1.0, 20.0])
@pytest.mark.parametrize(("stamps", "due"), STAMPS.values(), ids=STAMPS)
def test_when_each_frame_is_due(stamps: list[int], due: list[int], speed: float) -> None:
    for size in (1, 2, len(stamps)):
        frames = np.zeros(len(stamps), FRAME)
        frames["stamp_ns"] = MS * np.array(stamps)
        blocks = [frames[first : first + size] for first in range(0, len(frames), size)]
        found = np.concatenate([block["stamp_ns"] for block in timed(blocks, speed)])
        assert found.tolist() == [round(t * MS / speed) for t in due]


def blocks_of(due: list[int], size: int) -> list[RecordArray]:
    frames = np.zeros(len(due), FRAME)
    frames["stamp_ns"], frames["can_id"] = due, np.arange(len(due))
    return [frames[first : first + size] for first in range(0, len(due), size)]


DUE = {
    "apart": [k * 10 * MS for k in range(8)],
    "every 250 us": [k * 250 * US for k in range(400)],
    "every 15 us": [k * 15 * US for k in range(4000)],
    "13 at once": [k // 13 * 10 * MS for k in range(130)],
    "a gap of 10 s": [0, 10_000 * MS, 10_000 * MS + 1],
}


@pytest.mark.parametrize("wakes_late_us", [0, 5, 60, 150])
@pytest.mark.parametrize("size", [7, 1024])
@pytest.mark.parametrize("due", DUE.values(), ids=DUE)
def test_every_frame_leaves_when_it_is_due_though_the_machine_wakes_late(
    due: list[int], size: int, wakes_late_us: int
) -> None:
    clock = Clock(wakes_late_us * US)
    bus, sent = Bus(clock.source), Sent()
    send_on_schedule(blocks_of(due, size), bus, clock.source, sent)
    assert [can_id for _, can_id in bus.sent] == list(range(len(due)))
    late = np.array([t for t, _ in bus.sent]) - due
    late -= 5_000 * MS + player.LEAD_NS
    assert late.min() >= 0
    naps = wakes_late_us * US + player.NAP_NS if due[-1] < 100 * MS else 0  # of a bus without a pause
    assert np.quantile(late, 0.99) <= 30 * US + naps
    assert (sent.offered, sent.taken) == (len(due), len(due) - 1)
    assert sent.late.moments.count == len(due)
    assert sent.late.moments.maximum == pytest.approx(late.max(), abs=3 * US)  # of reading the clock


def test_who_was_held_up_goes_back_to_the_schedule() -> None:
    clock = Clock()
    bus, due = Bus(clock.source), [k * 10 * MS for k in range(10)]

    def held_up() -> list[RecordArray]:
        for block in blocks_of(due, 1):
            yield block
            if block["can_id"][0] == 3:
                clock.now += 25 * MS

    send_on_schedule(held_up(), bus, clock.source, Sent())
    late = (np.array([t for t, _ in bus.sent]) - due - bus.sent[0][0]) / MS
    np.testing.assert_allclose(late, [0, 0, 0, 0, 15, 5, 0, 0, 0, 0], atol=0.05)


def test_a_twentieth_of_the_time_is_left_to_others_on_a_bus_without_a_pause() -> None:
    clock = Clock(late_ns=2 * US)
    begin = clock.now
    send_on_schedule(
        blocks_of([k * 12 * US for k in range(20_000)], 1024), Bus(clock.source), clock.source, Sent()
    )
    assert clock.slept > 0.05 * (clock.now - begin)


def test_the_margin_follows_how_late_the_machine_wakes() -> None:
    clock = Clock(late_ns=150 * US)
    waker = Waker(clock.source)

    def watched(turns: int) -> float:
        """Mean time awake before an instant."""
        begin, slept = clock.now, clock.slept
        for _ in range(turns):
            waker.wait(clock.now + 5 * MS)
        return (clock.now - begin - (clock.slept - slept)) / turns

    watched(500)
    assert watched(100) < 20 * US  # 150 of the margin go by asleep
    clock.late_ns = 0
    assert watched(1) > 140 * US
    watched(1000)
    assert watched(100) < 30 * US


def test_raw_frames_go_out_as_they_are_from_one_interface(tmp_path: Path) -> None:
    log = tmp_path / "drive.log"
    log.write_text(
        "(1.000000) can0 100#01\n(1.000400) can0 101#02\n(1.000401) can1 102#03\n(1.000600) can0 103#04\n"
        "(1.000700) can0 104#R\n(1.000800) can0 20000080#0000000000000000\n"
    )
    findings = Findings(log)
    [frames] = raw_frames(log, "vcan0", findings)
    assert frames["can_id"].tolist() == [0x100, 0x101, 0x103]
    assert findings.other_interfaces == 1
    assert [block["can_id"].tolist() for block in raw_frames(log, "can1", Findings(log))] == [[0x102]]
    [timed] = timed_frames(log, None, "vcan0", 20.0, Findings(log))
    assert timed["stamp_ns"].tolist() == [0, 20_000, 30_000]


def write_signals(path: Path) -> Path:
    """A steady drive of a second; steering at 50 Hz, acceleration lost after 0.5 s."""
    lines = ["t,wheel_speed_fl,wheel_speed_fr,wheel_speed_rl,wheel_speed_rr,accel_x,steering_angle"]
    lines += [
        f"{k / 100},80,81,82,83,{-1.5 if k < 50 else ''},{0.02 if k % 2 == 0 else ''}" for k in range(100)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_decoded_signals_arrive_as_contract_frames_with_fresh_e2e(tmp_path: Path) -> None:
    path = write_signals(tmp_path / "drive.csv")
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    reception, inputs = new_reception(plan), new_record(INPUTS)
    for frames in contract_frames(path, load_source(None), Findings(path)):
        begin_cycle(inputs[0], int(frames["stamp_ns"][0]), CYCLE_NS)
        assert receive(plan, reception, frames, 0, len(frames), inputs[0]) == len(frames)
        end_cycle(inputs[0], reception.freshness)
    counters = reception.messages
    assert counters["accepted"].sum() == counters["received"].sum() > 500
    value, verdict = inputs[0]["value"], inputs[0]["verdict"]
    np.testing.assert_allclose(value[WHEEL_SPEED : WHEEL_SPEED + 4], [80, 81, 82, 83], atol=0.01)
    assert value[STEERING_ANGLE] == pytest.approx(0.02, abs=1e-3)
    usable = verdict & USABLE == USABLE
    assert usable[STEERING_ANGLE]
    assert not usable[ACCEL_X]


def heard_by(channel: str, log: Path, speed: float) -> tuple[int, list[tuple[int, bytes]]]:
    """Play onto a bus in this process; return the exit code and what is heard there."""
    with can.Bus(interface="virtual", channel=channel) as listener:
        code = play(log, "virtual", channel, None, speed)
        heard = iter(partial(listener.recv, 0), None)
        return code, [(message.arbitration_id, bytes(message.data)) for message in heard if message]


SENT = "20 frames sent, late by "


@pytest.mark.parametrize(
    ("end", "message"),
    [
        ("", ""),
        ("(1.000021) can0 114#15", "line 21: the last line is cut off and was not used"),
        ("(1.00002", "line 21: the last line is cut off and was not used"),
    ],
    ids=["whole", "without its end of line", "torn in the stamp"],
)
def test_a_bus_hears_the_drive_though_the_last_line_is_torn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], end: str, message: str
) -> None:
    log = tmp_path / "drive.log"
    log.write_text("".join(f"(1.{k:06d}) can0 {0x100 + k:03X}#{k:02X}\n" for k in range(20)) + end)
    assert heard_by("play-test", log, 1.0) == (0, [(0x100 + k, bytes([k])) for k in range(20)])
    printed = capsys.readouterr()
    assert printed.out.startswith(f"{log}: {SENT}")
    assert printed.out.count("\n") == 1
    assert printed.err == f"playing {log} onto virtual play-test; Ctrl-C ends it\n" + (
        f"{log}: {message}\n" if message else ""
    )


def test_damage_and_steps_of_the_clock_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "drive.log"
    log.write_text("(9.000000) can0 100#00\nnonsense\n(8.000000) can0 101#01\n(8.001000) can0 102#02\n")
    assert [can_id for can_id, _ in heard_by("play-back", log, 1.0)[1]] == [0x100, 0x101, 0x102]
    assert capsys.readouterr().err.splitlines()[1:] == [
        f"{log}: line 2: 1 damaged lines skipped, this is the first",
        f"{log}: time steps back at 1 frames; they count in the order of the log",
    ]


def test_ctrl_c_ends_it_with_what_was_sent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "drive.log"
    log.write_text("".join(f"({1 + k}.000000) can0 100#00\n" for k in range(100)))

    def interrupted(
        blocks: object, bus: object, source: object, sent: Sent
    ) -> None:  # in the middle of the drive
        sent.offered = sent.taken = 3
        raise KeyboardInterrupt

    monkeypatch.setattr(player, "send_on_schedule", interrupted)
    assert play(log, "virtual", "play-stop", None, 1.0) == INTERRUPTED
    assert capsys.readouterr().out == f"{log}: interrupted: 3 frames sent\n"


def test_a_refusal_of_priority_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "drive.log"
    log.write_text("(1.000000) can0 100#00\n")
    monkeypatch.setattr(player, "ask_for_priority", lambda: "Operation not permitted")
    assert play(log, "virtual", "play-rights", None, 1.0) == 0
    line, _ = capsys.readouterr().err.splitlines()
    assert line.startswith("SCHED_FIFO: Operation not permitted: frames may leave late; grant CAP_SYS_NICE")


SPEED = "give a factor from 0.1 to 20; 1 is real time"


@pytest.mark.parametrize(
    ("content", "speed", "line"),
    [
        *(
            ("(1.000000) can0 100#01\n", speed, f"--speed: {text}: {SPEED}")
            for speed, text in [
                (0.0, "0"),
                (0.09, "0.09"),
                (20.5, "20.5"),
                (-1.0, "-1"),
                (float("inf"), "inf"),
                (float("nan"), "nan"),
            ]
        ),
        ("(1.000000) can0 100#R\n", 1.0, "holds no frame that can be sent"),
        ("nonsense\n", 1.0, "line 1: no candump log"),
        (None, 1.0, "no such file"),
    ],
)
def test_what_cannot_be_played_gives_one_line(
    tmp_path: Path, content: str | None, speed: float, line: str
) -> None:
    log = tmp_path / "drive.log"
    if content is not None:
        log.write_text(content)
    with pytest.raises(UserError) as error:
        play(log, "virtual", "play-test", None, speed)
    assert line in str(error.value)


def test_a_map_beside_decoded_signals_is_reported_as_of_no_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, map = write_signals(tmp_path / "drive.csv"), resource("config/maps/mustang.toml")
    assert play(path, "virtual", "play-map", map, 20.0) == 0
    said = capsys.readouterr().err
    assert said.startswith(f"{map}: not used for {path}, whose signals are decoded already;")
    assert said.count("\n") == 2
