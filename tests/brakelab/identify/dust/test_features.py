"""Applications, background and emission of a trip whose truth is known in closed form."""

import numpy as np
import pytest

from brakelab.identify.dust.features import (
    PERIOD,
    Recorded,
    extract,
    find_applications,
    find_background,
    transport_time,
)
from ecu.errors import UserError

RADIUS, FLOW = 0.33, 0.07
STILL, BY_SPEED = 300.0, 20.0
PER_STOP = 1e9  # particles


def trip(delay: float = 2.0, stops: int = 10, noise: float = 0.0, holds: bool = False) -> Recorded:
    """Cruise at 10, 20 or 30 m/s for 100 s, brake by 5 m/s at 2 m/s^2, again; the plume is 4 s long."""
    random = np.random.default_rng(3)
    speed, braked = [], []
    for k in range(stops):
        top = (10.0, 20.0, 30.0)[k % 3]
        speed += [np.full(1000, top), top - 2.0 * PERIOD * np.arange(25), np.linspace(top - 5.0, top, 50)]
        braked += [np.zeros(1000), np.ones(25), np.zeros(50)]
    if holds:
        speed.append(np.zeros(300))
        braked.append(np.ones(300))
    v, on = np.concatenate(speed), np.concatenate(braked)
    t = PERIOD * np.arange(len(v))
    rate = np.zeros(len(v))
    for start in np.flatnonzero(np.diff(on, prepend=0.0) == 1.0)[:stops]:
        plume = start + round((delay - 0.7) / PERIOD) + np.arange(40)
        rate[plume[plume < len(v)]] = PER_STOP / 40 / PERIOD
    sampled = np.concatenate([np.full(round(delay / PERIOD), v[0]), v])[: len(v)]
    shown = rate / (1e6 * FLOW) + STILL + BY_SPEED * sampled
    shown *= 1.0 + noise * random.normal(size=len(v))
    return Recorded(
        "a", False, t, v, 15.0 * on + 0.3 * random.normal(size=len(v)), 400.0 * on * (v > 0.0),
        80.0 + 0.01 * t, shown, np.full(len(v), FLOW), np.ones(len(v), bool),
    )  # fmt: skip


def test_a_background_that_seems_to_fall_with_speed_is_their_mean():
    fast = trip()
    falls = fast._replace(concentration=fast.concentration - 2.0 * BY_SPEED * fast.speed)
    found = find_background(falls, find_applications(falls))
    assert found.by_speed == 0.0
    assert found.levels.min() < found.still < found.levels.max()


def test_an_application_that_was_not_counted_is_left_out():
    whole = trip()
    start = extract(whole, RADIUS).start[3]
    lost = np.abs(whole.t - start) < 10.0
    shown = np.where(lost, 0.0, whole.concentration)
    found = extract(whole._replace(concentration=shown, counted=~lost), RADIUS)
    assert (len(found.particles), found.left_out) == (9, 1)
    assert start not in found.start
    np.testing.assert_allclose(found.particles, np.delete(extract(whole, RADIUS).particles, 3), rtol=0.05)


def test_applications_and_their_conditions():
    """A rear view of (8.2): speeds, mean torque, mean temperature, duration; and the mean pressure."""
    found = extract(trip(), RADIUS)
    assert len(found.particles) == 10
    v_in, v_end, torque, heat, duration, pressure = found.features[0]
    assert v_in == pytest.approx(10.0, abs=0.6)
    assert v_end == pytest.approx(5.0, abs=0.8)
    assert (torque, duration) == (pytest.approx(400.0, rel=0.1), pytest.approx(2.5, abs=0.4))
    assert heat == pytest.approx(80.0 + 0.01 * 101.2, abs=0.1)
    assert pressure == pytest.approx(15.0, rel=0.1)
    assert found.energy[0] == pytest.approx(400.0 / RADIUS * 7.6 * 2.5, rel=0.02)
    assert found.decel.mean() == pytest.approx(2.0, rel=0.1)
    assert found.sequences.shape == (10, 37)


def test_an_application_ends_where_the_car_stands():
    held = find_applications(trip(holds=True))
    assert len(held) == 10
    assert all(PERIOD * (end - start) < 4.0 for start, end in held)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_particles_are_what_was_above_the_background(noise):
    found = extract(trip(noise=noise), RADIUS)
    error = found.particles / PER_STOP - 1.0
    print(error)
    assert np.abs(error).max() < (0.03 if noise == 0.0 else 0.12)
    assert found.factor == pytest.approx(np.log10(found.particles))


def test_background_is_a_line_over_speed():
    recorded = trip(delay=0.7, noise=0.05)
    found = find_background(recorded, find_applications(recorded))
    assert found.still == pytest.approx(STILL, rel=0.05)
    assert found.by_speed == pytest.approx(BY_SPEED, rel=0.05)
    assert found.factor == pytest.approx(np.ones(len(recorded.t)), abs=0.05)
    assert list(found.speeds) == [10.0, 20.0, 30.0]


def test_a_background_that_wanders_is_followed():
    recorded = trip(delay=0.7)
    wander = np.exp(0.3 * np.sin(2 * np.pi * recorded.t / 600.0))
    recorded = recorded._replace(concentration=recorded.concentration * wander)
    found = find_background(recorded, find_applications(recorded))
    ratio = found.at(recorded.speed) / (wander * (STILL + BY_SPEED * recorded.speed))
    assert np.std(np.log(ratio)) < 0.3 * np.std(np.log(wander))


@pytest.mark.parametrize("delay", [1.0, 3.0, 12.0, 25.0])
def test_the_transport_time_of_the_air(delay):
    """The plume's middle lies `delay` + 1.3 s behind the start, that of the application 1.25 s."""
    assert transport_time(trip(delay=delay)) == pytest.approx(delay, abs=0.8)


@pytest.mark.parametrize("delay", [6.0, 12.0, 20.0])
def test_a_long_transport_time_costs_no_particles(delay):
    """The background of the sampled air is that of the speed it was sampled at, too."""
    found = extract(trip(delay=delay), RADIUS)
    assert found.particles[:9] / PER_STOP == pytest.approx(np.ones(9), abs=0.05)


def test_a_trip_without_cruising_tells_no_background():
    """Its particles came out three times too many, without a word."""
    recorded = trip(delay=0.7)
    uneven = recorded.speed + 8.0 * np.sin(1.5 * recorded.t)
    with pytest.raises(
        UserError, match="trip a: vehicle_speed: no steady driving 25 s after a brake application"
    ):
        find_background(recorded._replace(speed=uneven), find_applications(recorded))


def test_a_counter_that_follows_no_braking_is_refused():
    with pytest.raises(UserError, match="trip a: particle_concentration: follows the braking by none"):
        transport_time(trip(delay=44.0))
