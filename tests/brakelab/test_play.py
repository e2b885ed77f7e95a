"""`brake-ecu play`: on schedule, as it was or as contract frames with fresh E2E."""

from pathlib import Path

import can
import numpy as np
import pytest

from brakelab.play import Burst, contract_bursts, play, raw_bursts, send_on_schedule
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from ecu.bus.channel import BusStatus
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import contract_receive_plan, new_reception, receive
from ecu.clock import TimeSource
from ecu.errors import UserError
from ecu.records import FRAME, INPUTS, RecordArray, new_record
from ecu.resources import resource
from ecu.signals import ACCEL_X, CYCLE_NS, STEERING_ANGLE, USABLE, WHEEL_SPEED


class Bus:
    """Notes when it was given what; takes all but the first frame of each burst."""

    name = "test"

    def __init__(self, source: TimeSource) -> None:
        self.source = source
        self.sent: list[tuple[int, int]] = []

    def drain(self, frames: RecordArray, start: int) -> int:
        return 0

    def send(self, frames: RecordArray, count: int) -> int:
        self.sent += [(self.source.monotonic_ns(), int(can_id)) for can_id in frames["can_id"][:count]]
        return count - 1

    def status(self) -> BusStatus:
        return BusStatus(False, False, 0, 0)

    def close(self) -> None:
        pass


def fake_time(late_ns: int = 0) -> TimeSource:
    now = [5_000_000_000]

    def sleep_until(deadline_ns: int) -> None:
        now[0] = max(now[0], deadline_ns) + late_ns

    return TimeSource(lambda: now[0], lambda: now[0], sleep_until)


def burst(t_ns: int, *ids: int) -> Burst:
    frames = np.zeros(len(ids), FRAME)
    frames["can_id"] = ids
    return Burst(t_ns, frames)


@pytest.mark.parametrize(("speed", "due"), [(1.0, [0, 10, 40]), (2.0, [0, 5, 20]), (0.5, [0, 20, 80])])
def test_bursts_leave_at_their_time_however_late_the_ones_before(speed: float, due: list[int]) -> None:
    source = fake_time(late_ns=3_000_000)
    bus = Bus(source)
    bursts = [burst(100, 1), burst(10_000_100, 2, 3), burst(40_000_100, 4)]
    assert send_on_schedule(bursts, bus, speed, source) == (4, 1)
    at = {can_id: (t - 5_000_000_000) // 1_000_000 for t, can_id in bus.sent}
    assert at == {1: 0, 2: due[1] + 3, 3: due[1] + 3, 4: due[2] + 3}


def test_raw_frames_go_out_as_they_are_from_one_interface(tmp_path: Path) -> None:
    log = tmp_path / "drive.log"
    log.write_text(
        "(1.000000) can0 100#01\n(1.000400) can0 101#02\n(1.000401) can1 102#03\n(1.000600) can0 103#04\n"
        "(1.000700) can0 104#R\n(1.000800) can0 20000080#0000000000000000\n"
    )
    findings = Findings(log)
    bursts = list(raw_bursts(log, "vcan0", findings))
    assert [(b.t_ns, list(b.frames["can_id"])) for b in bursts] == [
        (1_000_000_000, [0x100, 0x101]),
        (1_000_600_000, [0x103]),
    ]
    assert findings.other_interfaces == 1
    assert [list(b.frames["can_id"]) for b in raw_bursts(log, "can1", Findings(log))] == [[0x102]]


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
    for sent in contract_bursts(path, load_source(None), Findings(path)):
        frames = sent.frames.copy()
        frames["stamp_ns"] = sent.t_ns
        begin_cycle(inputs[0], sent.t_ns, CYCLE_NS)
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


def test_a_bus_hears_the_drive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "drive.log"
    log.write_text("".join(f"(1.{k:06d}) can0 {0x100 + k:03X}#{k:02X}\n" for k in range(20)))
    with can.Bus(interface="virtual", channel="play-test") as listener:
        assert play(log, "virtual", "play-test", None, 1.0) == 0
        heard = [listener.recv(0) for _ in range(20)]
    assert [(m.arbitration_id, bytes(m.data)) for m in heard if m] == [
        (0x100 + k, bytes([k])) for k in range(20)
    ]
    assert capsys.readouterr().out == f"{log}: 20 frames sent\n"


@pytest.mark.parametrize(
    ("content", "speed", "line"),
    [
        ("(1.000000) can0 100#01\n", 0.0, "--speed: 0: give a factor above 0"),
        ("(1.000000) can0 100#01\n", float("nan"), "--speed: nan: give a factor above 0"),
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


def test_a_map_beside_decoded_signals_is_told_to_be_of_no_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, map = write_signals(tmp_path / "drive.csv"), resource("config/maps/mustang.toml")
    assert play(path, "virtual", "play-map", map, 100.0) == 0
    assert capsys.readouterr().err == f"{map}: not used for {path}, whose signals are decoded already\n"
