"""Every kind of fault: what it does to frames, signals and the car, and what the ECU makes of it."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, Loop, new_loop, run
from brakelab.simulation.fault_kernels import HELD, deliver, new_link
from brakelab.simulation.faults import KEYS, KINDS, Fault, begun, fault_records
from brakelab.simulation.outages import START_UP
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.vehicle_bus import new_noise
from ecu.contract import faults as bits
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CORNERS, DEGRADED, OBSERVING
from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.resources import resource

ROOT = Path(__file__).parents[3]
CONFIG = load_config(ROOT / "config" / "suv.toml")
PRESSURE_FL = bits.PRESSURE_NOT_FOLLOWING | bits.IMPLAUSIBLE["calliper_pressure_fl"]


def test_the_page_has_the_keys_of_every_kind() -> None:
    page = (ROOT / "docs" / "rig.md").read_text("utf-8")
    rows = re.findall(
        r"^\| (`.*?) \| (.*?) ?\| .* \|$", page.partition("| kind | keys")[2].partition("**Bus-off")[0], re.M
    )
    listed = {
        kind: set(re.findall(r"`(\w+)`", keys))
        for kinds, keys in rows
        for kind in re.findall(r"`(\w+)`", kinds)
    }
    assert listed == KEYS


def identifier(name: str) -> int:
    return Fault(kind="lost", t=0.0, message=[name]).ids()[0]


def frames_sent(fault: dict[str, Any], cycles: int, name: str = "Imu") -> list[list[int]]:
    """Return which numbers arrive in each cycle of 10 ms when one frame numbered by its cycle is sent."""
    records, link, noise = fault_records([Fault(**fault)]), new_link(), np.random.default_rng(0)
    frames = new_record(FRAME)
    frames["can_id"], frames["length"] = identifier(name), 8
    arrived = []
    for cycle in range(cycles):
        frames["data"][0, :] = cycle % 256
        count = deliver(records, link, 0.01 * cycle, noise, frames, 1)
        arrived.append([int(frame["data"][7]) for frame in link.arrived[:count]])
    return arrived


FRAMES_SENT = {
    "lost": ({"kind": "lost", "t": 0.02, "duration": 0.02}, [[0], [1], [], [], [4], [5]]),
    "doubled": ({"kind": "doubled", "t": 0.02, "duration": 0.02}, [[0], [1], [2, 2], [3, 3], [4], [5]]),
    "late": ({"kind": "late", "t": 0.01, "duration": 0.02, "delay": 0.02}, [[0], [], [], [1], [2, 3, 4]]),
    "a gateway": (
        {"kind": "batched", "t": 0.015, "duration": 0.06, "delay": 0.03},
        [[0], [1], [], [2], [], [], [3, 4, 5], [], [], [6, 7, 8, 9]],
    ),
    "held up": ({"kind": "held_up", "t": 0.02, "duration": 0.03}, [[0], [1], [], [], [], [2, 3, 4, 5], [6]]),
    "bus off": ({"kind": "bus_off", "t": 0.03}, [[0], [1], [2], [], [], []]),
    "another message": ({"kind": "lost", "t": 0.0, "message": ["Steering"]}, [[k] for k in range(6)]),
    "not the ECU's": ({"kind": "lost", "t": 0.0}, [[k] for k in range(6)]),
}


@pytest.mark.parametrize("case", FRAMES_SENT)
def test_what_arrives(case: str) -> None:
    fault, expected = FRAMES_SENT[case]
    name = "PressureDemandFront" if case == "not the ECU's" else "Imu"
    assert frames_sent(fault, len(expected), name) == expected


def test_jitter_is_a_normal_draw_that_keeps_the_order() -> None:
    records, link, noise = (
        fault_records([Fault(kind="jittered", t=0.0, delay=0.005)]),
        new_link(),
        new_noise(3),
    )
    frames, late, last = new_record(FRAME), [], -1
    frames["can_id"], frames["length"] = identifier("Imu"), 8
    for cycle in range(2000):
        frames["stamp_ns"] = frames["data"][0, :8].view("i8")[0] = cycle * 10_000_000
        count = deliver(records, link, 0.01 * cycle, noise, frames, 1)
        for frame in link.arrived[:count]:
            sent, came = int(frame["data"][:8].view("i8")[0]), int(frame["stamp_ns"])
            assert last < sent <= came <= cycle * 10_000_000 + 100_000
            late.append(1e-9 * (came - sent))
            last = sent
    free = [value for value in late if value > 0.0]  # the others would have been early
    print(f"late by {np.mean(late):.4f} s, deviation {np.std(late):.4f} s, {len(free)} of {len(late)} at all")
    assert len(late) > 1995
    assert np.mean(late) == pytest.approx(0.0054, abs=4 * 0.005 / len(late) ** 0.5)  # by the draw's own form
    assert len(free) / len(late) == pytest.approx(0.84, abs=0.03)


def test_a_share_of_the_frames_is_hit() -> None:
    kept = sum(map(len, frames_sent({"kind": "lost", "t": 0.0, "share": 0.25}, 4000)))
    print(f"{kept} of 4000 frames kept")
    assert kept == pytest.approx(3000, abs=4 * (4000 * 0.25 * 0.75) ** 0.5)


def test_a_corrupted_frame_differs_in_one_bit() -> None:
    records, noise = fault_records([Fault(kind="corrupted", t=0.0)]), np.random.default_rng(1)
    frames, link, hit = new_record(FRAME), new_link(), set()
    frames["can_id"], frames["length"] = identifier("Imu"), 8
    for _ in range(600):
        assert deliver(records, link, 0.0, noise, frames, 1) == 1
        changed = np.unpackbits(link.arrived["data"][0] ^ frames["data"][0], bitorder="little")
        assert changed.sum() == 1
        hit.add(int(changed.argmax()))
    assert hit == set(range(64))


def test_frames_beyond_what_can_be_held_up_are_lost_not_written_elsewhere() -> None:
    records = fault_records([Fault(kind="late", t=0.0, delay=0.2)])
    frames, link, noise = new_record(FRAME, 40), new_link(), np.random.default_rng(0)
    frames["can_id"] = identifier("Imu")
    assert sum(deliver(records, link, 0.0, noise, frames, 40) for _ in range(20)) == 0
    assert np.isfinite(link.release).sum() == HELD


# A braking from 20 m/s; faults act from 2.0 s on.
STOP = """
plant = "suv"
draw = "nominal"
initial_speed = 20.0
{keys}
[[phase]]
kind = "coast"
seconds = 0.5
[[phase]]
kind = "brake"
decel = 4.0
seconds = 4.4
[[fault]]
t = 2.0
duration = 1.0
{fault}
"""


def driven(tmp_path: Path, fault: str, keys: str = "") -> tuple[Loop, Drive]:
    path = tmp_path / "stop.toml"
    path.write_text(STOP.format(fault=fault, keys=keys), "utf-8")
    loop = new_loop(load_scenario(path), CONFIG, 1)
    return loop, run(loop)


def rows(drive: Drive, begin: float, end: float) -> Any:
    return (drive.t >= begin - 1e-6) & (drive.t < end - 1e-6)


def decel_of(drive: Drive, within: Any) -> float:
    return float(-np.polyfit(drive.t[within], drive.truth["vehicle_speed"][within], 1)[0])


def raised(drive: Drive, begin: float, end: float) -> int:
    return int(np.bitwise_or.reduce(bits.fault_mask(drive.outputs)[rows(drive, begin, end)]))


@pytest.mark.parametrize(
    ("fault", "seen"),
    [
        ('kind = "lost"\nmessage = ["Imu"]', bits.IMU_LOST | bits.STEERING_LOST),
        ('kind = "lost"\nmessage = ["WheelSpeedFront"]', bits.WHEEL_SPEED_LOST),
        ('kind = "bus_off"', bits.REQUEST_LOST | bits.IMU_LOST | bits.PRESSURE_LOST),
        ('kind = "lost"\nshare = 0.05', 0),
        ('kind = "doubled"', bits.E2E_REJECTIONS),
        ('kind = "late"\ndelay = 0.05', 0),  # at its end frames of before and of now come together
        ('kind = "corrupted"\nshare = 0.2', bits.E2E_REJECTIONS),
    ],
)
def test_the_ecu_says_what_is_lost_within_its_time_out_and_takes_it_back(
    tmp_path: Path, fault: str, seen: int
) -> None:
    _, drive = driven(tmp_path, fault)
    assert raised(drive, 1.0, 2.0) == 0
    assert raised(drive, 2.0, 2.05) == 0  # 0.1 s of silence come first
    assert raised(drive, 2.0, 3.0) & seen == seen
    assert bool(raised(drive, 2.0, 3.0)) == bool(seen)
    assert raised(drive, 3.05, 3.9) & ~bits.E2E_REJECTIONS == 0  # that one is shown for a second


def test_doubled_and_corrupted_frames_are_rejected(tmp_path: Path) -> None:
    for fault in ('kind = "doubled"', 'kind = "corrupted"'):
        loop, _ = driven(tmp_path, fault)
        received = loop.sides.ecu_reception
        protected = received.messages[received.messages["received"] > 350]
        assert (protected["received"] - protected["accepted"]).min() >= 49, fault


def test_without_demands_the_hydraulics_brake_on_their_own(tmp_path: Path) -> None:
    _, drive = driven(tmp_path, 'kind = "lost"\nmessage = ["PressureDemandFront"]')
    heard = drive.truth["demand_heard"]
    assert heard[rows(drive, 1.0, 2.02)].all()  # the last one came at 1.99 s and counts for 30 ms
    assert not heard[rows(drive, 2.02, 3.01)].any()
    assert heard[rows(drive, 3.01, 3.9)].all()


@pytest.mark.parametrize(
    ("fault", "name", "shift", "spread"),
    [
        ('kind = "stuck"\nsignal = ["calliper_pressure_fl"]', "calliper_pressure_fl", None, 0.0),
        ('kind = "biased"\nsignal = ["accel_x"]\namount = 0.5', "accel_x", 0.5, 0.012),
        ('kind = "noisy"\nsignal = ["calliper_pressure"]\namount = 6.0', "calliper_pressure_rr", 0.0, 6.3),
    ],
)
def test_a_signal_is_spoilt_as_asked(
    tmp_path: Path, fault: str, name: str, shift: float | None, spread: float
) -> None:
    _, drive = driven(tmp_path, fault)
    within = rows(drive, 2.01, 3.0)
    if shift is None:
        assert np.ptp(drive.inputs[name][within]) == spread
        return
    error = drive.inputs[name][within] - drive.truth[name][within]
    print(f"{name}: {error.mean():.3f} ± {error.std():.3f}")
    assert error.mean() == pytest.approx(shift, abs=4 * spread / 10 + 0.01)
    assert error.std() == pytest.approx(spread, rel=0.25)


WHEEL = "wheel_speed_fl"


def _later(truth: Any, seconds: float) -> Any:
    return np.roll(truth[WHEEL], round(100 * seconds))


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ('kind = "set"\namount = 12.5', lambda t, truth: np.full(len(t), 12.5)),
        # The bus carries no less than -20 rad/s.
        ('kind = "scaled"\namount = -1.0', lambda t, truth: np.maximum(-truth[WHEEL], -20.0)),
        ('kind = "drifting"\nrate = -4.0\nlimit = 3.0', lambda t, truth: truth[WHEEL] - np.minimum(4 * t, 3)),
        (
            'kind = "scale_drifting"\nrate = 0.1\nlimit = 0.05',
            lambda t, truth: truth[WHEEL] * (1 + np.minimum(0.1 * t, 0.05)),
        ),
        ('kind = "delayed"\ndelay = 0.05', lambda t, truth: _later(truth, 0.05)),
        ('kind = "delayed"\ndelay = 0.2', lambda t, truth: _later(truth, 0.2)),
        ('kind = "swapped"', lambda t, truth: truth["wheel_speed_rl"]),
    ],
)  # fmt: skip
def test_a_wheel_speed_lies_as_asked_and_no_longer(tmp_path: Path, fault: str, expected: Any) -> None:
    signals = [WHEEL, "wheel_speed_rl"] if "swapped" in fault else [WHEEL]
    _, drive = driven(tmp_path, f"{fault}\nsignal = {signals}")
    lies, honest = rows(drive, 2.0, 3.0), rows(drive, 3.0, 3.9)
    error = drive.inputs[WHEEL] - expected(drive.t - 2.0, drive.truth)
    assert np.abs(error[lies]).max() < 0.5
    assert np.abs(drive.inputs[WHEEL] - drive.truth[WHEEL])[honest].max() < 0.5


@pytest.mark.parametrize(
    ("signal", "amount", "keys", "bit", "after", "again"),  # s after the fault and after its end
    [
        ("accel_x", 0.7, "", bits.ACCEL_IMPLAUSIBLE, 0.4, 0.6),
        ("accel_x", -0.7, "", bits.ACCEL_IMPLAUSIBLE, 0.4, 0.6),
        ("accel_x", 0.7, "motor_share = 0.5", bits.ACCEL_IMPLAUSIBLE, 0.4, 0.6),
        ("accel_x", 0.15, "", 0, 0.0, 0.6),
        ("calliper_pressure_fl", 20.0, "", PRESSURE_FL, 0.45, 1.6),
        ("calliper_pressure_fl", 3.0, "", 0, 0.0, 0.6),
    ],
)
def test_a_sensor_that_contradicts_the_others_is_reported_and_not_followed(
    tmp_path: Path, signal: str, amount: float, keys: str, bit: int, after: float, again: float
) -> None:
    fault = f'kind = "biased"\nsignal = ["{signal}"]\namount = {amount}'
    _, drive = driven(tmp_path, fault, keys)
    assert raised(drive, 0.0, 2.0) == 0
    assert raised(drive, 2.0 + after, 3.0) == bit
    assert raised(drive, 3.0 + again, 4.9) == 0
    if not bit:
        return
    within = rows(drive, 2.0 + after, 3.0)
    assert np.all(drive.outputs["mode"][within] == DEGRADED)
    error = drive.outputs["mu_b_fl"][within] / drive.truth["mu_b_fl"][within] - 1.0
    before, decel = decel_of(drive, rows(drive, 1.2, 2.0)), decel_of(drive, within)
    print(f"friction off by {error.min():+.1%} to {error.max():+.1%}, {before:.2f} then {decel:.2f} m/s^2")
    assert np.abs(error).max() < 0.13  # 0.7 m/s^2 are 17 %
    assert decel == pytest.approx(before, rel=0.06)  # braking goes on as it was
    assert decel == pytest.approx(4.0, rel=0.10)
    assert drive.outputs["mode_fl"][within][-1] == OBSERVING


def test_motors_fail_and_come_back(tmp_path: Path) -> None:
    _, drive = driven(tmp_path, 'kind = "motor_lost"\ncorner = ["rl", "rr"]', "motor_share = 0.3")
    torque = {corner: drive.truth[f"motor_torque_{corner}"] for corner in CORNERS}
    for begin, end, gone in ((1.2, 2.0, ()), (2.1, 3.0, ("rl", "rr")), (3.2, 3.9, ())):
        for corner in CORNERS:
            working = float(np.abs(torque[corner][rows(drive, begin, end)]).max())
            assert (working < 1.0) == (corner in gone), (begin, corner, working)
    assert np.nanmax(drive.inputs["motor_limit_rl"][rows(drive, 2.02, 3.0)]) == 0.0


def test_an_accumulator_that_is_low_limits_the_pressure(tmp_path: Path) -> None:
    _, drive = driven(tmp_path, 'kind = "accumulator_low"\namount = 20.0')
    pressure = drive.truth["calliper_pressure_fl"]
    assert pressure[rows(drive, 1.5, 2.0)].max() > 30.0
    assert pressure[rows(drive, 2.3, 3.0)].max() <= 20.0
    assert pressure[rows(drive, 3.5, 3.9)].max() > 30.0
    for begin, end, ready in ((1.0, 2.0, True), (2.05, 3.0, False), (3.05, 3.9, True)):
        assert bool(raised(drive, begin, end) & bits.HYDRAULICS_NOT_READY) != ready


@pytest.mark.parametrize(("standby", "silent"), [(False, 1.0 + START_UP), (True, 0.06)])
def test_a_killed_daemon_is_silent_and_knows_its_friction_afterwards(
    tmp_path: Path, standby: bool, silent: float
) -> None:
    scenario = load_scenario(resource("config/scenarios/faults/killed.toml"))
    fault = Fault(kind="daemon_killed", t=9.0, standby=standby, duration=None if standby else 1.0)
    drive = run(new_loop(scenario.model_copy(update={"fault": [fault]}), CONFIG, 1))
    dead = np.isnan(drive.outputs["mode"])
    assert dead.sum() == pytest.approx(100 * silent, abs=1)
    assert drive.t[dead][0] == pytest.approx(9.0)
    before, after = (drive.outputs["mu_b_fl"][place] for place in np.flatnonzero(dead)[[0, -1]] + [-1, 1])
    print(f"friction {before:.3f} before, {after:.3f} after")
    # The store has the mean of the braking before, a standby what it estimated itself.
    assert after == pytest.approx(before, rel=0.01 if standby else 0.15)


@pytest.mark.parametrize(
    ("when", "reached"),
    [
        ("vehicle_speed < 12", lambda truth: truth["vehicle_speed"] < 12.0),
        ("vehicle_speed<18", lambda truth: truth["vehicle_speed"] < 18.0),  # before t: at t
        ("accel_x < -2.0", lambda truth: truth["accel_x"] < -2.0),
        ("vehicle_speed > 40.5", None),
    ],
)
def test_a_fault_begins_when_its_condition_holds(tmp_path: Path, when: str, reached: Any) -> None:
    """At `t` = 2 s at the soonest, and for its duration of 1 s, whether the condition still holds or not."""
    fault = f'kind = "set"\nsignal = ["accel_y"]\namount = 5.0\nwhen = "{when}"'
    _, drive = driven(tmp_path, fault)
    acting = drive.truth["fault_acting"] == 1.0
    spoilt = drive.inputs["accel_y"] > 4.0
    if reached is None:
        assert not acting.any()
        assert not spoilt.any()
        (began,) = begun(load_scenario(tmp_path / "stop.toml").fault, drive.t, drive.truth["fault_acting"])
        assert math.isinf(began.t)
        return
    first = drive.t[reached(drive.truth) & (drive.t > 2.0 - 1e-6)][0]
    assert drive.t[acting][0] == pytest.approx(first, abs=0.06)  # by what the sensor reads
    assert acting.sum() == 100 or acting[-1]
    assert drive.t[spoilt][0] == pytest.approx(drive.t[acting][0], abs=0.02)
    (began,) = begun(load_scenario(tmp_path / "stop.toml").fault, drive.t, drive.truth["fault_acting"])
    assert (began.t, began.end) == pytest.approx((drive.t[acting][0], drive.t[acting][0] + 1.0))


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ('kind = "broken"', "fault.1.kind"),
        ('kind = "lost"\nwhen = "slow"', "'slow' is no condition; write it as vehicle_speed < 15"),
        ('kind = "lost"\nwhen = "speed < 15"', "'speed' is not one of the ECU's inputs"),
        ('kind = "lost"\nwhen = "wheel_speed < 15"', "'wheel_speed' is not one of"),
        ('kind = "bus_off"\nwhen = "vehicle_speed < 15"', "when does not belong to the kind 'bus_off'"),
        ('kind = "late"', "'late' needs delay"),
        ('kind = "stuck"', "'stuck' needs signal"),
        ('kind = "lost"\nsignal = ["accel_x"]', "signal does not belong to the kind 'lost'"),
        ('kind = "lost"\nmessage = ["Imo"]', "no 'Imo' in the database"),
        ('kind = "biased"\nsignal = ["accel_w"]\namount = 1.0', "'accel_w' is none of the ECU's inputs"),
        ('kind = "swapped"\nsignal = ["accel_x"]', "swapped are two signals"),
        ('kind = "swapped"\nsignal = ["wheel_speed", "accel_x"]', "swapped are two signals"),
        ('kind = "drifting"\nsignal = ["accel_x"]\nrate = 1.0', "'drifting' needs limit"),
    ],
)
def test_a_mistake_is_one_line(tmp_path: Path, fault: str, line: str) -> None:
    with pytest.raises(UserError) as raised:
        driven(tmp_path, fault)
    assert line in str(raised.value)


def test_every_kind_is_shipped_as_a_scenario() -> None:
    shipped = [load_scenario(path) for path in resource("config/scenarios/faults").glob("*.toml")]
    assert {fault.kind for scenario in shipped for fault in scenario.fault} == set(KINDS)
