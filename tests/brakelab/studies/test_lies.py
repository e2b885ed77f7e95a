"""What a cell of the study of lies says of two drives, and what the page says of cells."""

import math

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive
from brakelab.studies import lies_table
from brakelab.studies.lies import (
    ANALOGUE,
    CARS,
    INPUTS,
    ROADS,
    SLOW,
    SPLIT_ACCEL,
    cells,
    lies,
    ramps,
    scenario,
)
from brakelab.studies.lies_cell import DECEL, Cell, judge
from brakelab.studies.lies_table import drift_table, driven, lie_tables, why
from ecu.contract.faults import ACCEL_IMPLAUSIBLE, IMPLAUSIBLE, MOTOR_SHORT, WHEEL_SLIPS, WORD
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CORNERS

T = np.arange(0.0, 50.0, 0.01)
MASS, RADIUS, TORQUE = 2000.0, 0.3, 600.0
BEGIN = 30.0  # s, of the braking after the lie began
OWN, OTHER = IMPLAUSIBLE["wheel_speed_fl"], IMPLAUSIBLE["accel_y"]
NAME = ("suv", "straight", "wheel speed front left", "stuck")


def drive(
    share: float = 1.0,
    lost: tuple[float, float] = (0.0, 0.0),
    faults: dict[int, float] | None = None,
    front: float = 1.0,
    motors: float = 0.0,
) -> Drive:
    """Return a drive with a braking before and one after the lie.

    Args:
        share: of the force, in `lost` [s] after the second braking began.
        lost: from, until.
        faults: when each bit is set [s].
        front: friction believed over the true one.
        motors: torque demanded of each [N m].
    """
    braking = ((T >= 10.0) & (T < 15.5)) | ((T >= BEGIN) & (T < BEGIN + 5.5))
    begins, ends = BEGIN + lost[0], BEGIN + lost[1]
    force = np.where((begins <= T) & (ends > T), share, 1.0)
    mask = np.zeros(len(T), np.int64)
    for bit, since in (faults or {}).items():
        mask |= np.where(since <= T, bit, 0)
    outputs = {"mode": np.full_like(T, 2.0), "active_faults": 1.0 * (mask % 2**WORD)}
    outputs["active_faults_2"] = 1.0 * (mask >> WORD)
    truth = {"decel_demand": np.where(braking, DECEL, 0.0), "vehicle_speed": np.full_like(T, 20.0)}
    for corner in CORNERS:
        truth[f"brake_torque_{corner}"] = TORQUE * force
        truth[f"rolling_radius_{corner}"] = np.full_like(T, RADIUS)
        truth[f"mu_b_{corner}"] = np.full_like(T, 0.4)
        truth[f"motor_torque_{corner}"] = truth[f"slip_{corner}"] = np.zeros_like(T)
        outputs[f"mu_b_{corner}"] = np.full_like(T, 0.4 * (front if corner in ("fl", "fr") else 1.0))
        outputs[f"motor_demand_{corner}"] = np.full_like(T, motors)
    return Drive(T, {}, outputs, truth, new_record(FRAME, 0))


def cell(sound: Drive | None = None, **lie) -> Cell:
    return judge(NAME, drive(**lie), sound or drive(), MASS, ("wheel_speed_fl",))


FORCE = [
    # share, from, until [s in the braking]: least for 0.3 s, for 2 s, greatest for 2 s, taken, off [s]
    (1.0, (0.0, 0.0), 1.0, 1.0, 1.0, 0.0, 0.0),
    (0.8, (1.0, 1.2), 1.0, 1.0, 1.0, 0.2, 0.2),
    (0.8, (1.0, 2.0), 0.8, 1.0, 1.0, 1.0, 1.0),
    (0.95, (1.0, 4.0), 0.95, 0.95, 1.0, 0.0, 3.0),
    (1.2, (1.0, 4.0), 1.0, 1.0, 1.2, 0.0, 3.0),
    (0.5, (0.0, 0.45), 1.0, 1.0, 1.0, 0.0, 0.0),  # while the brakes build up
]


@pytest.mark.parametrize(("share", "lost", "short", "long", "most", "taken", "off"), FORCE)
def test_how_much_is_taken_for_how_long(share, lost, short, long, most, taken, off) -> None:
    found = cell(share=share, lost=lost)
    assert (found.least_short, found.least_long, found.most_long) == pytest.approx((short, long, most))
    assert (found.taken_s, found.off_s) == pytest.approx((taken, off), abs=0.011)
    assert found.costs == (off > 2.0)
    settled = max(lost[1] - max(lost[0], 0.5), 0.0)
    assert found.mean == pytest.approx(1.0 + (share - 1.0) * settled / 5.0, abs=1e-3)


REPORTED = [
    # when faults come [s]; named after the lie's beginning, after it cost; first
    ({}, math.nan, math.nan, 0),
    ({OWN: 22.0}, 2.0, 0.0, OWN),
    ({OWN: BEGIN + 2.5}, 12.5, 1.5, OWN),
    ({OTHER: 25.0, OWN: BEGIN + 4.0}, 14.0, 3.0, OTHER),
    ({WHEEL_SLIPS: 25.0}, math.nan, math.nan, WHEEL_SLIPS),
]


@pytest.mark.parametrize(("faults", "named", "late", "first"), REPORTED)
def test_when_the_lie_is_reported_and_as_what(faults, named, late, first) -> None:
    found = cell(share=0.9, lost=(1.0, 5.0), faults=faults)
    assert (found.named_s, found.late_s) == pytest.approx((named, late), nan_ok=True, abs=0.011)
    assert found.first == first


NAMES = [
    ("wheel_speed_fl", OWN, True),
    ("accel_x", ACCEL_IMPLAUSIBLE, True),
    ("motor_limit_fl", MOTOR_SHORT, True),
    ("motor_torque_fl", MOTOR_SHORT, False),
]


@pytest.mark.parametrize(("signal", "bit", "named"), NAMES)
def test_the_faults_that_name_an_input(signal: str, bit: int, named: bool) -> None:
    found = judge(NAME, drive(faults={bit: 25.0}), drive(), MASS, (signal,))
    assert math.isfinite(found.named_s) == named


def test_what_the_sound_car_tells_is_an_alarm_and_not_the_lie_s() -> None:
    found = cell(drive(faults={OTHER: 12.0, WHEEL_SLIPS: 12.0}), faults={OTHER: 12.0, OWN: 25.0})
    assert (found.alarms, found.first) == (OTHER, OWN)


CAUSES = [
    ({"front": 1.25}, {}, "front friction believed +25 %"),
    ({"motors": 50.0}, {"motors": 100.0}, "motors asked for 50 %"),
    ({"faults": {WHEEL_SLIPS: BEGIN + 1.1}}, {}, "wheel slips"),
    ({"faults": {WHEEL_SLIPS: BEGIN + 1.1}}, {"faults": {WHEEL_SLIPS: BEGIN}}, "none of these"),
    ({"faults": {WHEEL_SLIPS: BEGIN + 4.5}}, {}, "none of these"),  # later
]


@pytest.mark.parametrize(("lie", "sound", "cause"), CAUSES)
def test_why_is_what_differs_where_it_is_worst(lie, sound, cause) -> None:
    assert why(cell(drive(**sound), share=0.7, lost=(1.0, 4.0), **lie)) == cause


def test_the_page_counts_the_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lies_table, "WORST_LIES", 2)
    found = [
        cell(),
        cell(share=0.5, lost=(1.0, 4.0)),
        cell(share=0.8, lost=(1.0, 4.0), faults={OWN: 31.5}),
        cell(share=1.3, lost=(1.0, 4.0), faults={OWN: BEGIN + 4.0}),
    ]
    roads, inputs, worst, alarms = lie_tables(found, 0)
    assert [row[0] for row in roads.rows] == ["suv, straight", "all"]
    assert roads.rows[0][1:] == inputs.rows[0][1:] == roads.rows[1][1:]
    assert roads.rows[0][1:5] == ("4", "0.50", "0.50–1.30", f"{np.mean([c.mean for c in found]):.3f}")
    assert roads.rows[0][5:] == ("2", "3.0", "3", "3.0", "1 (33 %)")
    assert [row[2] for row in worst.rows] == ["0.50", "1.00"]
    assert alarms.rows == [("suv, straight, car 1", "–", "–")]


def test_the_page_says_of_slow_drifts_when_they_are_named_and_what_they_cost() -> None:
    """A drift downwards that costs 10 % and is named, one upwards that costs 20 % and is not."""
    down, up = cell(share=0.9, lost=(1.0, 4.0), faults={OWN: 25.0}), cell(share=1.2, lost=(1.0, 4.0))
    drifts = [down._replace(lie=lie) for lie in ramps(NAME[2], SLOW) if "-" in lie]
    drifts += [up._replace(lie=lie) for lie in ramps(NAME[2], SLOW) if "+" in lie]
    found = drift_table(drifts)
    assert [row[:4] for row in found.rows] == [
        (NAME[2], kind, "– / 5.0", "0.90–1.20") for kind in ("scale", "zero")
    ]
    assert {len(row) for row in found.rows} == {len(found.columns)} == {2 + len(SLOW)}


def test_the_page_says_what_was_not_driven() -> None:
    left = [f"{car} {road}" for car in CARS for road in ROADS][1:]
    assert driven([cell()]) == f"1 lies; not driven: {', '.join(left)}."
    whole = [cell()._replace(car=car, road=road) for car in CARS for road in ROADS]
    assert driven(whole) == "12 lies, every car on every road."


@pytest.mark.parametrize("name", INPUTS)
def test_every_input_has_its_lies(name: str) -> None:
    assert lies(name)
    assert all(set(fault.signal) for fault in lies(name).values())


@pytest.mark.parametrize("name", ANALOGUE)
def test_every_input_drifts_slowly_up_and_down(name: str) -> None:
    rates = {fault.rate for fault in ramps(name, SLOW).values()}
    assert len(rates) >= len(SLOW)
    assert rates == {-rate for rate in rates}


def test_an_axle_that_drives_on_a_split_spins_at_more() -> None:
    """With 5 m/s^2 the sedan's driven rear wheels spin, and the car with them."""
    assert {phase.accel for phase in scenario("sedan", "split", []).phase if phase.kind == "cruise"} == {
        SPLIT_ACCEL
    }


def test_a_car_is_driven() -> None:
    """The sound car beside one whose flag stands at 0, as it does anyway."""
    (same,) = cells("suv", "straight", "rain", 1, ("stuck at 0",))
    assert (same.least_short, same.most_long, same.alarms) == (1.0, 1.0, 0)
    assert same.cause.friction == pytest.approx((1.0, 1.0))


HELD = [
    # car, road, input, lie: force over demand for 0.3 s at least, for 2 s at most
    ("suv-blended", "downhill", "wheel speeds front", "-20 %", 0.97, 1.03),  # 0.41 while one jump was a slip
    ("suv-blended", "downhill", "wheel speeds front", "zero -5 %", 0.97, 1.03),  # 0.43
    ("suv", "downhill", "vehicle_speed", "zero -0.1 %/s", 0.97, 1.08),  # 1.51 by the wheels' word alone
    ("sedan", "straight", "vehicle_speed", "zero -0.1 %/s", 0.97, 1.10),  # 1.48
    ("suv", "split", "accel_x", "ramp -1 %/s", 0.95, 1.10),  # 0.80 once it was left out
    ("sedan", "curve", "accel_x", "zero -1 %/s", 0.95, 1.05),  # 0.70
    ("sedan", "split", "wheel speeds front", "delay 200 ms", 0.95, 1.05),  # 0.49, the rear was held back
    ("sedan", "split", "wheel speed front left", "ramp +0.1 %/s", 0.95, 1.05),  # 0.80
    (
        "suv",
        "split",
        "wheel speeds rear",
        "delay 200 ms",
        0.95,
        1.07,
    ),  # 0.66 while nobody said that it is late
    ("suv", "curve", "wheel speeds rear", "delay 200 ms", 0.95, 1.10),  # 0.66
    (
        "sedan",
        "split",
        "wheel speeds front",
        "noise × 10",
        0.95,
        1.05,
    ),  # 0.82, the accelerometer was corrected
    ("sedan", "downhill", "accel_x", "delay 200 ms", 0.88, 1.05),  # 0.69, left out for good
    ("suv", "straight", "wheel speeds, all", "+20 %", 0.97, 1.07),  # 0.87, the vehicle speed was left out
    ("suv", "straight", "wheel speeds, all", "ramp -1 %/s", 0.97, 1.07),  # 1.14
    ("sedan", "downhill", "motor torques, all", "zero -1 %/s", 0.90, 1.08),  # 0.75: taken for the slope
    ("suv-blended", "split", "pressures, all", "sign", 0.97, 1.03),  # 0.73, motors accused, model late
    ("suv-blended", "split", "pressures, all", "ramp -0.5 %/s", 0.95, 1.03),  # 0.84, learned as friction
    ("suv", "curve", "motor torque front left", "zero", 0.95, 1.03),  # 0.88, learned as usual
]


@pytest.mark.study
@pytest.mark.parametrize(("car", "road", "name", "lie", "least", "most"), HELD)
def test_a_lie_that_once_took_the_brakes_takes_them_no_longer(car, road, name, lie, least, most) -> None:
    [found] = cells(car, road, name, 1, (lie,))
    print(f"{found.least_short:.2f} to {found.most_long:.2f}")
    assert found.least_short > least
    assert found.most_long < most
