"""What stands still while the car does not; what may, gives no line. Wrong drives: test_judge.py."""

import numpy as np
import pytest

from brakelab.logs.physics.samples import SAMPLED, InputSeries
from brakelab.logs.physics.stuck import clipped_accels, clipped_pressures, runs, stuck_pressures, stuck_wheels
from ecu.contract.signals import INPUT_SIGNALS

PLACE = {INPUT_SIGNALS[place].name: column for column, place in enumerate(SAMPLED)}
WHEELS, PRESSURES = (
    [PLACE[f"{stem}_{corner}"] for corner in ("fl", "fr", "rl", "rr")]
    for stem in ("wheel_speed", "calliper_pressure")
)
ROWS = 3000  # of 20 ms


def stops(decels: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return rows of the grid, and the speed [m/s], of brakings of 2 s from 25 m/s, 10 bar per m/s^2."""
    t = 0.02 * np.arange(ROWS)
    decel = np.zeros(ROWS)
    for k, each in enumerate(decels):
        decel[(t >= 10 * k + 3) & (t < 10 * k + 5)] = each
        decel[(t >= 10 * k + 6) & (t < 10 * k + 10)] = -each / 2
    speed = 25.0 - np.cumsum(decel) * 0.02
    rows = np.full((ROWS, len(SAMPLED)), np.nan)
    rows[:, WHEELS] = (speed / 0.33)[:, None]
    rows[:, PRESSURES] = np.clip(10.0 * decel, 0.0, None)[:, None]
    rows[:, PLACE["accel_x"]] = -decel
    return rows, speed


@pytest.mark.parametrize(
    ("decels", "range_bar", "reported"),
    [
        ([3.0, 4.0, 5.0], 25.0, True),
        ([3.0, 4.0, 5.0], 60.0, False),
        ([3.0, 3.0, 3.0], 60.0, False),  # the same braking three times, without any noise
        ([5.0, 1.0], 25.0, False),  # one braking alone could be one that was held
    ],
)
def test_pressures_that_end_at_one_value(decels: list[float], range_bar: float, reported: bool) -> None:
    rows, speed = stops(decels)
    rows[:, PRESSURES] = np.minimum(rows[:, PRESSURES], range_bar)
    line = clipped_pressures(InputSeries(rows), np.gradient(speed, 0.02), np.ones(ROWS, np.bool_))
    assert bool(line) == reported
    assert not reported or "fl fr rl rr stand at 25.0 bar" in line


@pytest.mark.parametrize(
    ("begin", "seconds", "bar", "reported"),
    [
        (4.0, 8.0, 30.0, True),
        (5.5, 4.0, 30.0, True),
        (5.5, 4.0, 2.0, False),  # released, its zero 2 bar off
        (3.0, 2.0, 30.0, False),  # the brake is held, without any noise
    ],
)
def test_a_pressure_that_stands_while_the_car_gains_speed(
    begin: float, seconds: float, bar: float, reported: bool
) -> None:
    rows, speed = stops([3.0, 4.0, 5.0])
    rows[int(50 * begin) : int(50 * (begin + seconds)), PRESSURES] = bar
    whole = np.ones(ROWS, np.bool_)
    line, clear = stuck_pressures(InputSeries(rows), np.gradient(speed, 0.02), whole)
    assert line.startswith(f"calliper_pressure_*: fl fr rl rr stand at {bar:.1f} bar for") == reported
    assert clear.all() != reported


@pytest.mark.parametrize(("range_", "reported"), [(4.0, True), (6.0, False)])
def test_an_acceleration_that_ends_below_what_the_car_reaches(range_: float, reported: bool) -> None:
    rows, speed = stops([3.0, 4.0, 5.0])
    column = PLACE["accel_x"]
    rows[:, column] = np.clip(rows[:, column], -range_, range_)
    lines, clear = clipped_accels(InputSeries(rows), speed, np.ones(ROWS, np.bool_))
    assert [line.startswith("accel_x: stands at -4.00 m/s^2") for line in lines] == [True] * reported
    assert clear.all() != reported


@pytest.mark.parametrize(
    ("begin", "seconds", "value", "cause"),
    [
        (12.0, 8.0, 40.0, "frozen"),
        (0.0, 2.9, 75.0, ""),  # all of them stand at a constant speed
        (13.0, 2.0, 0.0, ""),  # locked by the brakes
        (10.0, 15.0, 0.0, "frozen"),  # no brake locks a wheel for so long
    ],
)
def test_a_wheel_that_stands_while_the_others_change(
    begin: float, seconds: float, value: float, cause: str
) -> None:
    rows, speed = stops([3.0, 4.0, 5.0])
    rows[int(50 * begin) : int(50 * (begin + seconds)), WHEELS[2]] = value
    wheels = np.tile(speed[:, None], 4)
    lines, mended = stuck_wheels(InputSeries(rows), wheels, np.ones(ROWS, np.bool_))
    assert [cause in line for line in lines] == ([True] if cause else [])
    assert np.allclose(mended, wheels)


def test_runs_at_both_ends() -> None:
    at = np.array([1, 1, 0, 1, 0, 1, 1, 1], np.bool_)
    assert runs(at, 2) == [slice(0, 2), slice(5, 8)]
