"""An accelerometer against wheels and torques: what is said of it, when, and of what nothing is said.

A car of this table is three series: what the torques give, what the accelerometer reads and how the wheels
slow down. They differ as slope, lining and sensor make them differ.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.acceleration import ACCELERATION_STATE, watch_acceleration
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.params import GRAVITY
from ecu.contract.records import RecordArray
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE

JUMP = 3.0  # s
Series = Callable[[float], float]


def braked(t: float) -> float:
    """Force over mass: 2 m/s^2 from the beginning on."""
    return -2.0


def begins(t: float) -> float:
    """4 m/s^2 within 0.3 s."""
    return -4.0 * min(max((t - JUMP) / 0.3, 0.0), 1.0)


def lets_go(t: float) -> float:
    """2.5 m/s^2 forwards, and nothing within 0.2 s."""
    return 2.5 * min(max(1.0 - (t - JUMP - 0.5) / 0.2, 0.0), 1.0)


def steps(height: float, since: float = JUMP, until: float = 99.0) -> Series:
    return lambda t: height if since <= t < until else 0.0


def ramps(rate: float) -> Series:
    return lambda t: rate * max(t - JUMP, 0.0)


def none(t: float) -> float:
    return 0.0


# what, force by the torques, on top of it: of car (reading and dv/dt), of dv/dt alone, of the reading alone;
# said after [s], None: never
CASES: list[tuple[str, Series, Series, Series, Series, float | None]] = [
    ("brakes", braked, none, none, none, None),
    ("brakes harder", begins, none, none, none, None),
    ("a slope of 8 % at once", braked, none, steps(-0.8), none, None),
    ("a slope at once while braking begins", begins, none, steps(-0.8), none, None),
    ("on a slope of 20 % from the first", braked, none, steps(-2.0, 0.0), none, None),
    ("on one of 35 %", braked, none, steps(-3.4, 0.0), none, None),
    ("wet discs: half the force is gone", braked, steps(1.0), none, none, None),
    ("friction a quarter beside its base", begins, lambda t: 0.25 * begins(t), none, none, None),
    ("a fifth beside it on a hill that begins", begins, lambda t: 0.2 * begins(t), ramps(-0.6), none, None),
    ("the sensor jumps by 0.15", braked, none, none, steps(0.15), None),
    ("by 0.5", braked, none, none, steps(0.5), 0.2),
    ("by -0.5", braked, none, none, steps(-0.5), 0.2),
    ("by 3", braked, none, none, steps(3.0), 0.1),
    ("by 0.5 as a slope begins", braked, none, ramps(0.6), steps(0.5), 0.2),
    ("it drifts by 0.2 in a second", braked, none, none, ramps(0.2), None),
    ("by 3 in a second", braked, none, none, ramps(3.0), 0.3),
    ("0.5 beside from the first", braked, none, none, steps(0.5, 0.0), None),
    ("4 beside from the first", braked, none, none, steps(4.0, 0.0), -1.2),
    ("sticks before the brakes act", begins, none, none, lambda t: -begins(t), 0.2),
]


def drive(
    params: RecordArray,
    feed: Any,
    force: Series,
    car: Series,
    wheels: Series,
    reading: Series,
    seconds: float = 6.0,
    motors: bool = True,
    slope: float = 0.0,
    named_until: float = 0.0,
    **disturbed: Any,
) -> list[bool]:
    """Return in which cycles the reading was implausible.

    `motors`: their torque is reported; `slope` [m/s^2]: as it is known; `named_until` [s]: it is left out by
    its name from half a second after `JUMP` on; `disturbed`: inputs from `JUMP` on.
    """
    rng = np.random.default_rng(7)
    p = params[0]
    state, estimate = np.zeros(1, ACCELERATION_STATE)[0], np.zeros(1, ESTIMATE)[0]
    estimate["mu"] = p["mu_nominal"]
    base, witness = p["mu_nominal"].copy(), np.zeros(1, WITNESS_STATE)[0]
    inputs, speed, said = feed(), 30.0, []
    for k in range(round(100 * seconds)):
        t = 0.01 * k
        a = force(t) + car(t)
        speed += 0.01 * (a + wheels(t))
        slip = a / (GRAVITY * p["slip_stiffness"][0])
        omega = speed * (1.0 + slip) / p["wheel_radius"] + rng.normal(0.0, p["sigma_wheel_speed"], 4)
        seen = (a + reading(t)) * (1.0 + GRAVITY * p["pitch_gradient"]) + rng.normal(0.0, p["sigma_accel"])
        torque = -force(t) * p["mass"] * p["wheel_radius"] / 4.0 + rng.normal(0.0, 10.0, 4)
        values = {"wheel_speed": omega, "accel_x": seen, "motor_torque": torque, "calliper_pressure": 0.0}
        feed(inputs, **(values | disturbed if t >= JUMP else values))
        if not motors:
            inputs[0]["verdict"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = 0
        estimate["speed"] = speed
        witness["rejected"][ACCEL_X] = JUMP + 0.5 < t < named_until
        watch_acceleration(p, state, witness, inputs[0], estimate, base, slope, False, 0.01)
        said.append(bool(state["implausible"]))
    return said


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_a_reading_is_doubted_where_neither_wheels_nor_torques_confirm_it(params, feed, case) -> None:
    _, force, car, wheels, reading, after = case
    said = drive(params, feed, force, car, wheels, reading)
    found = 0.01 * said.index(True) - JUMP if any(said) else None
    print(found)
    assert found == (None if after is None else pytest.approx(after, abs=0.11))


@pytest.mark.parametrize("back", [0.5, 2.0])
def test_it_is_believed_again_when_it_reads_as_before(params, feed, back: float) -> None:
    said = drive(params, feed, braked, none, none, steps(0.5, JUMP, JUMP + back))
    gone = len(said) - said[::-1].index(True)
    print(f"said for {0.01 * sum(said):.2f} s, to {0.01 * gone - JUMP - back:.2f} s after the recovery")
    assert 0.01 * gone - JUMP - back == pytest.approx(0.25, abs=0.11)
    assert sum(said) == gone - said.index(True)  # once


@pytest.mark.parametrize(("slope", "again"), [(0.0, False), (0.3, True)])
def test_a_reading_is_believed_again_on_the_slope_that_was_known(params, feed, slope, again: bool) -> None:
    """One that was late as the brakes came agreed with nothing just before."""

    def late(t: float) -> float:
        return 0.0 if t < JUMP else 0.6 if t < JUMP + 1.0 else 0.3

    said = drive(params, feed, braked, none, none, late, slope=slope)
    assert any(said)
    assert said[-1] != again


# force by the torques, on top of it: of car, of the reading
STILL_WRONG = [
    pytest.param(lambda t: -4.0 if t < 5.0 else 0.0, none, steps(0.8, JUMP, 5.0), id="a scale, rolling"),
    pytest.param(lambda t: -4.0, steps(-0.8, 5.0), steps(0.8), id="a zero, linings rub more"),
    pytest.param(lets_go, none, lambda t: 0.2 * lets_go(t) * (t >= JUMP), id="a scale, as motors let go"),
]


@pytest.mark.parametrize(("force", "car", "reading"), STILL_WRONG)
def test_a_reading_that_is_still_wrong_is_not_believed(
    params, feed, force: Series, car: Series, reading: Series
) -> None:
    """A scale shows at no lesser deceleration; linings are no witness, for their friction changes."""
    said = drive(params, feed, force, car, none, reading)
    assert all(said[round(100 * JUMP) + 40 :])


def test_one_that_jumped_and_was_late_is_not_believed_because_it_is_in_time(params, feed) -> None:
    said = drive(params, feed, braked, none, none, steps(0.5), named_until=JUMP + 1.5)
    assert all(said[round(100 * JUMP) + 40 :])


def test_it_is_believed_again_at_standstill(params, feed) -> None:
    said = drive(params, feed, lambda t: -8.0, none, none, steps(0.8, 2.0), seconds=4.5)
    assert said[round(100 * 30.0 / 8.0) - 50]
    assert not any(said[round(100 * 30.0 / 8.0) + 1 :])


@pytest.mark.parametrize(
    "disturbed",
    [
        {"abs_active": 1.0},
        {"esp_active": 1.0},
        {"reverse": 1.0},
        {"wheel_speed": [1.0, 60.0, 60.0, 60.0]},
    ],
)
def test_nothing_is_said_while_a_wheel_slides_or_another_brakes(
    params, feed, disturbed: dict[str, Any]
) -> None:
    assert any(drive(params, feed, braked, none, none, steps(1.0)))
    assert not any(drive(params, feed, braked, none, none, steps(1.0), **disturbed))


def unreported(params: RecordArray) -> dict[str, Any]:
    return {"motors": False}


def badly_known(params: RecordArray) -> dict[str, Any]:
    params["sigma_motor_torque"] = 0.15
    return {}


# what the reading does [m/s^2], said after [s], and no longer so long after the reading is right again [s]
BY_WHEELS_ALONE = [
    pytest.param(steps(1.0), None, id="a jump by 1: a slope may do that"),
    pytest.param(steps(-1.8), None, id="by -1.8"),
    pytest.param(steps(3.5), 1.2, id="by 3.5: no road does"),
    pytest.param(steps(-3.5), 1.2, id="by -3.5"),
    pytest.param(steps(3.5, JUMP, JUMP + 0.6), None, id="by 3.5 for a moment"),
    pytest.param(steps(3.5, 0.0), -1.2, id="3.5 beside from the first"),
]


@pytest.mark.parametrize("drive_torque", [unreported, badly_known])
@pytest.mark.parametrize(("reading", "after"), BY_WHEELS_ALONE)
def test_where_the_drive_s_torque_is_not_known_only_what_no_road_does_is_doubted(
    params, feed, drive_torque, reading: Series, after: float | None
) -> None:
    said = drive(params, feed, braked, none, none, reading, **drive_torque(params))
    found = 0.01 * said.index(True) - JUMP if any(said) else None
    print(found)
    assert found == (None if after is None else pytest.approx(after, abs=0.25))


def test_and_is_believed_again_once_a_road_could_do_it(params, feed) -> None:
    said = drive(params, feed, braked, none, none, steps(3.5, 0.5, JUMP), 8.0, motors=False)
    assert said[round(100 * JUMP) - 1]
    gone = 0.01 * (len(said) - said[::-1].index(True)) - JUMP
    print(gone)
    assert 0.0 < gone < 0.6


def test_forces_that_are_reported_tell_what_wheels_alone_do_not(params, feed) -> None:
    assert any(drive(params, feed, braked, none, none, steps(1.0)))
    assert not any(drive(params, feed, braked, none, none, steps(1.0), motors=False))


OPPOSED = [
    # case, reading [m/s^2], dv/dt of the wheels, accelerator [%], reverse, said in 3 s at 4 m/s^2
    ("the sensor is turned round", 4.0, -4.0, 0.0, 0.0, True),
    ("it sticks at what driving off gave", 1.5, -4.0, 0.0, 0.0, True),
    ("it reads what a hill may do", 0.8, -4.0, 0.0, 0.0, False),
    ("the driver accelerates against the brakes", 1.5, -4.0, 50.0, 0.0, False),
    ("the car reverses", 4.0, -4.0, 0.0, 1.0, False),
    ("the wheels do not slow down", 4.0, 0.5, 0.0, 0.0, False),
    ("all wheels lock on ice", -1.0, -12.0, 0.0, 0.0, False),
]


@pytest.mark.parametrize(
    ("case", "reading", "wheels", "gas", "reverse", "found"), OPPOSED, ids=[row[0] for row in OPPOSED]
)
def test_a_reading_forwards_while_linings_slow_the_wheels_is_wrong(
    params, feed, case, reading, wheels, gas, reverse, found
) -> None:
    """The speed follows the reading, so that no wheel seems to roll; no motor reports its torque."""
    p, state = params[0], np.zeros(1, ACCELERATION_STATE)[0]
    witness, estimate = np.zeros(1, WITNESS_STATE)[0], np.zeros(1, ESTIMATE)[0]
    base, inputs, speed, rolled = p["mu_nominal"], feed(), 25.0, 25.0
    estimate["mu"], estimate["brake_torque"] = base, 4.0 * p["mass"] * p["wheel_radius"] / 4.0
    inputs[0]["verdict"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = 0
    said = []
    for _ in range(300):
        speed, rolled = speed + 0.01 * reading, max(rolled + 0.01 * wheels, 0.0)
        accelerator = {"accelerator_position": gas, "reverse": reverse}
        feed(inputs, wheel_speed=rolled / p["wheel_radius"], accel_x=reading, **accelerator)
        estimate["speed"] = speed
        watch_acceleration(p, state, witness, inputs[0], estimate, base, 0.0, True, 0.01)
        said.append(bool(state["implausible"]))
    assert any(said) == found
    if found:
        assert 0.01 * said.index(True) < 0.5
