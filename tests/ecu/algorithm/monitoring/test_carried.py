"""Which of wheels and vehicle speed the accelerometer confirms."""

import numpy as np
import pytest

from ecu.algorithm.monitoring.carried import (
    CARRIED_STATE,
    OVER_GROUND,
    WHEELS,
    carry_speeds,
    follow_carried,
    over_ground_confirmed,
)

DT = 0.01
CASES = [
    # case, lie of the wheels after 60 s: factor, per s, plus [m/s]; that of the vehicle speed; slope then,
    # confirmed
    ("nobody lies", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, False),
    ("the wheels jump by 5 %", (1.05, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, True),
    ("the vehicle speed does", (1.0, 0.0, 0.0), (1.05, 0.0, 0.0), 0.0, False),
    ("the wheels drift by 1 %/s", (1.0, 0.01, 0.0), (1.0, 0.0, 0.0), 0.0, True),
    ("the vehicle speed does", (1.0, 0.0, 0.0), (1.0, 0.01, 0.0), 0.0, False),
    ("a slope of 6 % begins", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.6, False),
    ("and the wheels are 1 m/s too fast", (1.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.6, False),
    ("without the slope", (1.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.0, True),
]


@pytest.mark.parametrize(("case", "wheels", "over_ground", "slope", "confirmed"), CASES)
def test_whom_the_accelerometer_confirms(case, wheels, over_ground, slope, confirmed) -> None:
    """A car that brakes and accelerates on a slope of 3 %; 3 s after the lie began."""
    state, speed, known = np.zeros(1, CARRIED_STATE)[0], 20.0, 0.3
    for k in range(6300):
        t = k * DT
        lies = t >= 60.0
        along = 2.0 * np.sin(0.6 * t)
        speed += along * DT
        accel = along + known + (slope if lies else 0.0)
        for witness, (factor, rate, plus) in ((WHEELS, wheels), (OVER_GROUND, over_ground)):
            reported = speed * (factor + rate * (t - 60.0)) + plus if lies else speed
            follow_carried(state, witness, reported, accel, DT)
    assert over_ground_confirmed(state) == confirmed


def test_a_speed_that_was_silent_is_carried_anew(params) -> None:
    state = np.zeros(1, CARRIED_STATE)[0]
    for speed in (20.0, 20.0, np.nan, 15.0):
        follow_carried(state, OVER_GROUND, speed, 0.0, DT)
    assert state["behind"][OVER_GROUND] == 0.0
    assert not over_ground_confirmed(state)


@pytest.mark.parametrize("spinning", [2, 3])
def test_wheels_that_spin_as_the_car_is_driven_carry_nothing_on(params, spinning) -> None:
    """The car drives off at 4 m/s^2; the vehicle speed begins to drift: the accelerometer confirms it not."""
    state, speed = np.zeros(1, CARRIED_STATE)[0], 20.0
    for k in range(1400):
        accel = 0.0 if k < 600 else -4.0 if k < 1030 else 4.0
        speed += accel * DT
        spun = speed + 8.0 if 1040 < k < 1150 else speed * (1.03 if accel > 0.0 else 1.0)
        wheels = [spun] * spinning + [speed] * (4 - spinning)
        implied = np.array([*wheels, speed + 0.03 * k * DT])
        carry_speeds(params[0], state, implied, accel, True, accel > 0.0, DT)
    assert not over_ground_confirmed(state)
