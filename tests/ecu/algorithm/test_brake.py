"""A disc brake by hand: torque of a pressure (A.19)."""

import pytest

from ecu.algorithm.brake import brake_gain, brake_gain_per_bar


@pytest.mark.parametrize("corner", range(4))
def test_two_pads_press_with_the_pistons_area_at_the_effective_radius(params, corner: int) -> None:
    car = params[0]
    force = 30e5 * car["piston_area"][corner]
    torque = 2 * 0.45 * force * car["effective_radius"][corner]
    assert brake_gain(car, corner) * 0.45 * 30e5 == pytest.approx(torque)
    assert brake_gain_per_bar(car, corner) * 0.45 * 30.0 == pytest.approx(torque)
