"""A wheel that brakes and turns faster than the car: said after 0.3 s, of nothing else."""

import numpy as np
import pytest

from ecu.estimation.motion import MOTION_STATE
from ecu.monitoring.plausibility import PLAUSIBILITY_STATE, wheel_speed_implausible
from ecu.signals import MOTOR_TORQUE, WHEEL_SPEED

CASES = [
    # what, turns over ground, brake torque [N m], motor torque [N m], car's speed [m/s], implausible
    ("rolls", 1.00, 0.0, 0.0, 20.0, False),
    ("brakes", 0.98, 800.0, 0.0, 20.0, False),
    ("slides", 0.60, 800.0, 0.0, 20.0, False),
    ("locked", 0.00, 800.0, 0.0, 20.0, False),
    ("stuck while the car slows", 1.10, 800.0, 0.0, 20.0, True),
    ("stuck while it regenerates too", 1.10, 800.0, 300.0, 20.0, True),
    ("spins under the motor", 1.30, 800.0, -900.0, 20.0, False),
    ("a small tyre", 1.04, 800.0, 0.0, 20.0, False),
    ("too slow to tell", 1.30, 800.0, 0.0, 3.0, False),
    ("not braked", 1.30, 20.0, 0.0, 20.0, False),
]


@pytest.mark.parametrize(("what", "turns", "torque", "motor", "speed", "implausible"), CASES)
@pytest.mark.parametrize("wheel", [0, 3])
def test_a_wheel_that_brakes_is_not_faster_than_the_car(
    params,
    feed,
    wheel: int,
    what: str,
    turns: float,
    torque: float,
    motor: float,
    speed: float,
    implausible: bool,
) -> None:
    state, motion = np.zeros(1, PLAUSIBILITY_STATE)[0], np.zeros(1, MOTION_STATE)[0]
    inputs = feed()
    torques = np.full(4, torque)
    inputs[0]["value"][WHEEL_SPEED : WHEEL_SPEED + 4] = 0.98 * speed / params[0]["wheel_radius"]
    inputs[0]["value"][WHEEL_SPEED + wheel] = turns * speed / params[0]["wheel_radius"][wheel]
    inputs[0]["value"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = motor
    said = [
        wheel_speed_implausible(params[0], state, inputs[0], motion, speed, torques, 0.01) for _ in range(50)
    ]
    assert any(said) == implausible
    if implausible:
        assert said.index(True) == pytest.approx(30, abs=1)
