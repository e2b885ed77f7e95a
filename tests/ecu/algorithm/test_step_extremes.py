"""Drives that no ordinary stop contains: wheels locked without a speed reference, reverse."""

import numpy as np
import pytest

from ecu.algorithm.step import new_state, step
from ecu.contract.params import GRAVITY
from ecu.contract.records import OUTPUTS, new_record
from ecu.contract.signals import INPUT

CYCLE_S = 0.01


def drive(params, feed, seconds: float, quantities):
    """Return the outputs of each cycle; `quantities(t)` names the inputs, no speed reference among them."""
    state, rows = new_state(params), []
    for k in range(round(seconds / CYCLE_S)):
        inputs = feed(**quantities(CYCLE_S * k))
        for name in ("vehicle_speed", "vehicle_speed_valid"):
            inputs[0]["verdict"][INPUT[name]] = inputs[0]["new"][INPUT[name]] = 0
        outputs = new_record(OUTPUTS)
        step(params, state, inputs, outputs)
        rows.append(outputs[0].copy())
    return np.array(rows)


def wheels(speed: float, radius: float) -> dict[str, float]:
    return {f"wheel_speed_{corner}": speed / radius for corner in ("fl", "fr", "rl", "rr")}


def test_four_locked_wheels_do_not_pass_for_the_cars_speed(params, feed) -> None:
    radius, decel = float(params[0]["wheel_radius"][0]), 4.0
    body = 1.0 + GRAVITY * params[0]["pitch_gradient"]

    def sliding(t: float) -> dict[str, float]:
        if t < 2.0:
            return wheels(25.0, radius)
        pressures = {f"calliper_pressure_{corner}": 60.0 for corner in ("fl", "fr", "rl", "rr")}
        return {**wheels(0.0, radius), **pressures, "accel_x": -decel * body}

    rows = drive(params, feed, 6.0, sliding)
    assert rows["vehicle_speed"][-1] == pytest.approx(25.0 - 4.0 * decel, abs=0.5)
    assert (rows["mu_b"][-1] == rows["mu_b"][0]).all()


@pytest.mark.parametrize("sign", [-1.0, 1.0], ids=["sensors with a sign", "sensors without"])
def test_reverse_is_a_negative_speed(params, feed, sign: float) -> None:
    radius = float(params[0]["wheel_radius"][0])
    rows = drive(params, feed, 5.0, lambda t: {**wheels(sign * 4.0, radius), "reverse": 1.0})
    assert rows["vehicle_speed"][-1] == pytest.approx(-4.0, abs=0.1)
