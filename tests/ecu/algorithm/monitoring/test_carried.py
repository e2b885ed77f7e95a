"""Which of wheels and vehicle speed the accelerometer confirms."""

import numpy as np
import pytest

from ecu.algorithm.monitoring.carried import (
    CARRIED_STATE,
    OVER_GROUND,
    WHEELS,
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
