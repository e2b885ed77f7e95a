"""A brake in its enclosure: work, transport of particles, background, the counter's second."""

import numpy as np
import pytest

from brakelab.plant.description import Plant, nominal
from brakelab.plant.emission_rig import (
    CONCENTRATION,
    EMITTED,
    HEAT,
    PRESSURE,
    SPEED,
    STEP,
    TORQUE,
    TRIP,
    T,
    run_trip,
)


def still(**changes) -> np.ndarray:
    trip = np.zeros(1, TRIP)
    values = {
        "ambient": 20.0,
        "flow": 0.07,
        "delay": 1.0,
        "mixing": 1.0,
        "response": 0.8,
        "settled_for": 60.0,
    }
    for name, value in {**values, "day": 1.0, "work": 1e9, **changes}.items():
        trip[0][name] = value
    return trip


def stop(decel: float = 2.0, speed: float = 20.0, after: float = 60.0) -> np.ndarray:
    """Cruise, a braking to half of the speed, and cruise."""
    t = np.arange(0.0, 40.0 + after, STEP)
    v = np.clip(speed - decel * np.maximum(t - 20.0, 0.0), 0.5 * speed, speed)
    return np.column_stack((v, np.gradient(v, STEP), np.zeros(len(t))))


def run(car, trip, drive, scatter=(1.0,)):
    out = np.zeros((len(drive) // 10 + 1, EMITTED + 1))
    rows, count = run_trip(car[0], 1, trip[0], drive, np.ones(len(drive)), np.array(scatter), out)
    return out[:rows], count


def test_the_brake_does_the_work_that_drag_and_rolling_leave(suv: Plant):
    car = nominal(suv)
    car["drag_factor"] = car["rolling_resistance"] = 0.0
    out, count = run(car, still(), stop())
    radius, mass = car["free_radius"][0, 1], car["mass"][0]
    work = np.sum(out[:, TORQUE] * out[:, SPEED]) / radius * 0.1
    length = car["front_length"][0] + car["rear_length"][0]
    share = (car["rear_length"][0] + car["cog_height"][0] * 2.0 / 9.81) / length
    assert count == 1
    assert work == pytest.approx(0.5 * share * 0.5 * mass * (20.0**2 - 10.0**2), rel=0.03)
    assert out[:, HEAT].max() - 20.0 == pytest.approx(car["heating"][0, 1] * work, rel=0.1)


def test_what_was_emitted_goes_through_the_tunnel(suv: Plant):
    car = nominal(suv)
    out, _ = run(car, still(), stop())
    counted = np.sum(out[:, CONCENTRATION]) * 0.1 * 0.07 * 1e6
    assert counted == pytest.approx(out[-1, EMITTED], rel=0.03)
    later = np.average(out[:, T], weights=out[:, CONCENTRATION])
    gain = np.gradient(out[:, EMITTED])
    assert later - np.average(out[:, T], weights=gain) == pytest.approx(1.0 + 1.0 + 0.8 + 0.45, abs=0.15)


def test_what_settles_comes_off_while_driving(suv: Plant):
    car = nominal(suv)
    out, _ = run(car, still(settles=0.5, settled_for=20.0), stop(after=200.0))
    counted = np.cumsum(out[:, CONCENTRATION]) * 0.1 * 0.07 * 1e6
    soon = counted[np.searchsorted(out[:, T], 35.0)]
    assert soon / out[-1, EMITTED] == pytest.approx(0.65, abs=0.1)
    assert counted[-1] == pytest.approx(out[-1, EMITTED], rel=0.03)


@pytest.mark.parametrize("speed", [0.0, 10.0, 30.0])
def test_background_grows_with_speed(suv: Plant, speed):
    drive = np.column_stack((np.full(6000, speed), np.zeros(6000), np.zeros(6000)))
    out, count = run(nominal(suv), still(background=300.0, background_by_speed=20.0), drive)
    assert count == 0
    assert out[-1, CONCENTRATION] == pytest.approx(300.0 + 20.0 * speed, rel=1e-3)


def test_the_counter_is_read_once_a_second(suv: Plant):
    out, _ = run(nominal(suv), still(), stop())
    assert np.all(np.diff(out[:, CONCENTRATION]).reshape(-1)[np.arange(len(out) - 1) % 10 != 9] == 0.0)


def test_scatter_is_of_an_application(suv: Plant):
    drive = np.concatenate([stop(after=0.0), stop(after=0.0)])
    plain, count = run(nominal(suv), still(), drive)
    some, _ = run(nominal(suv), still(), drive, (1.0, 3.0))
    half = len(plain) // 2
    first, whole = plain[half, EMITTED], plain[-1, EMITTED]
    assert count == 2
    assert some[-1, EMITTED] == pytest.approx(first + 3.0 * (whole - first), rel=1e-3)


def test_the_standing_car_is_held_by_its_brake(suv: Plant):
    drive = np.zeros((500, 3))
    out, _ = run(nominal(suv), still(), drive)
    assert np.all(out[:, PRESSURE] > 10e5)
    assert out[-1, EMITTED] == 0.0
