"""One cycle of estimation, whichever observer is in use: what each must say of the car."""

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.step import new_state, step
from ecu.contract.params import JOINT, OBSERVER1, OBSERVER2
from ecu.contract.records import OUTPUTS

OBSERVERS = [JOINT, OBSERVER1, OBSERVER2]
SPEED = 20.0  # m/s
RATIOS = {"test_ratio", "test_ratio_balance", "test_ratio_speed"}
GRIP = ("grip_limit", "sigma_grip_limit", "grip_knee", "grip_fall")
NOT_ESTIMATED = {
    JOINT: {"test_ratio_balance", "test_ratio_speed"},  # nothing brakes or drives, and there is no reference
    # Only a filter of the whole car knows these.
    OBSERVER1: {"sigma_force", "sigma_overrun", "overrun_power", *GRIP, *RATIOS},
    OBSERVER2: {"sigma_force", "sigma_overrun", "overrun_power", *GRIP, *RATIOS},
}


def roll(params, feed, observer: int, seconds: float, bars=(0.0, 0.0, 0.0, 0.0), **values):
    """Let a car roll at 20 m/s with the pressure readings `bars`, 0.1 bar of noise; return its estimate."""
    params[0]["observer"] = observer
    state, outputs, random = new_state(params), np.zeros(1, OUTPUTS), np.random.default_rng(5)
    inputs = feed(wheel_speed=SPEED / params[0]["wheel_radius"], **values)
    for _ in range(round(100 * seconds)):
        feed(inputs, calliper_pressure=np.array(bars) + 0.1 * random.standard_normal(4))
        step(params, state, inputs, outputs)
    return state["estimate"][0]


@pytest.mark.parametrize("observer", OBSERVERS)
def test_every_observer_says_all_that_it_knows(params, feed, observer: int) -> None:
    estimate = roll(params, feed, observer, 1.0, vehicle_speed_valid=0.0)
    unknown = {name for name in ESTIMATE.names or () if not np.isfinite(estimate[name]).all()}
    assert unknown == NOT_ESTIMATED[observer]
    assert estimate["started"]
    assert estimate["speed"] == pytest.approx(SPEED, abs=0.2)
    assert estimate["mass"] == pytest.approx(params[0]["mass"], rel=0.05)
    assert estimate["load"].sum() == pytest.approx(params[0]["mass"] * 9.81, rel=0.01)
    assert estimate["mu"] == pytest.approx(params[0]["mu_nominal"])


@pytest.mark.parametrize("observer", OBSERVERS)
def test_every_observer_learns_what_the_pressure_sensors_read_at_rest(params, feed, observer: int) -> None:
    """Readings of 0.1 s counts: n samples beside the hundred of the prior."""
    bars = np.array([0.3, -0.3, 0.2, 0.0])
    found = roll(params, feed, observer, 6.0, bars)["pressure_zero"]
    assert found == pytest.approx(bars * 600 / 700, abs=0.03)


@pytest.mark.parametrize(("armed", "known"), [(0, True), (1, False)])
def test_a_bystander_learns_zeros_that_look_like_a_brake_application(params, feed, armed, known) -> None:
    """The car speeds up, so nothing brakes it; where this ECU brakes, it may be its own pressure."""
    params[0]["transmit"] = armed
    found = roll(params, feed, JOINT, 6.0, (2.0,) * 4, accel_x=1.0, accelerator_position=30.0)
    assert (np.abs(found["pressure_zero"] - 2.0) < 0.4).all() == known


@pytest.mark.parametrize("observer", OBSERVERS)
def test_brake_torque_is_without_the_pressure_zero(params, feed, observer: int) -> None:
    """(A.19) by hand: 30 bar read by sensors with a known zero of 1.2 bar."""
    car, state, outputs = params[0], new_state(params), np.zeros(1, OUTPUTS)
    car["observer"] = observer
    zero = state["joint"]["zero"]
    zero["mean"], zero["square"], zero["samples"], zero["below"] = 1.2, 1.2**2 + 0.01, 12_000, 1
    zero["value"] = 1.2
    inputs = feed(wheel_speed=SPEED / car["wheel_radius"], calliper_pressure=30.0, accel_x=-4.0)
    for _ in range(20):
        mu = state["estimate"]["mu"][0].copy()
        step(params, state, inputs, outputs)
    force = (30.0 - 1.2) * 1e5 - car["push_out_pressure"]
    torque = 2.0 * car["piston_area"] * car["effective_radius"] * mu * force
    assert state["estimate"]["brake_torque"][0] == pytest.approx(torque, rel=0.01)


@pytest.mark.parametrize("observer", OBSERVERS)
def test_nothing_is_learned_while_a_deceleration_is_asked_for(params, feed, observer: int) -> None:
    params[0]["transmit"] = 0
    found = roll(params, feed, observer, 3.0, (0.4, 0.4, 0.4, 0.4), pedal_position=30.0)["pressure_zero"]
    assert np.abs(found).max() < 0.01


@pytest.mark.parametrize("observer", [OBSERVER1, OBSERVER2])
def test_nothing_is_learned_of_a_brake_that_is_applied_a_little(params, feed, observer: int) -> None:
    """0.9 bar above push-out: no application yet, and nobody says why. The first 50 ms tell nothing of it."""
    assert np.abs(roll(params, feed, observer, 3.0, (1.4, 1.4, 1.4, 1.4))["pressure_zero"]).max() < 0.1


@pytest.mark.parametrize(("doubted_s", "measured_s"), [(0.0, 2.7), (3.0, 0.0), (1.5, 1.2)])
def test_a_stream_in_doubt_teaches_no_whole_application(
    params, feed, doubted_s: float, measured_s: float
) -> None:
    """A shadow sees a braking of 3 s at 4 m/s^2 by wheels that roll; the doubt lasts that long."""
    car, state, outputs = params[0], new_state(params), np.zeros(1, OUTPUTS)
    car["transmit"] = 0
    inputs, speed = feed(), 30.0
    for k in range(400):
        brakes = k >= 100
        speed -= 0.04 * brakes
        feed(
            inputs,
            wheel_speed=speed / car["wheel_radius"],
            calliper_pressure=40.0 * brakes,
            accel_x=-4.0 * brakes,
            yaw_rate=0.0,
        )
        inputs["e2e_unsure"] = brakes and k < 100 + 100 * doubted_s
        step(params, state, inputs, outputs)
    assert state["whole"]["time"][0] == pytest.approx(measured_s, abs=0.1)


@pytest.mark.parametrize(
    ("case", "to", "teaches"), [("still rolls", 2.0, False), ("held at rest", 0.0, True)]
)
def test_a_stop_teaches_before_its_brakes_are_released(
    params, feed, case: str, to: float, teaches: bool
) -> None:
    """A shadow sees a braking at 4 m/s^2, and a second in which nothing changes; the log ends there."""
    car, state, outputs = params[0], new_state(params), np.zeros(1, OUTPUTS)
    car["transmit"] = 0
    inputs, speed = feed(), 14.0
    for k in range(600):
        slows = k >= 100 and speed > to
        speed -= 0.04 * slows
        feed(
            inputs,
            wheel_speed=speed / car["wheel_radius"],
            calliper_pressure=40.0 * (k >= 100),
            accel_x=-4.0 * slows,
            yaw_rate=0.0,
        )
        step(params, state, inputs, outputs)
    assert (state["learned"]["mu_b"][0] != car["mu_nominal"]).all() == teaches
