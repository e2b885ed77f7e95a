"""Disc temperature on board: closed forms, energy, error bars and lost signals."""

import itertools
import math

import numpy as np
import pytest

from ecu.algorithm.estimation.friction import update_pressure
from ecu.algorithm.monitoring.application import update_application
from ecu.algorithm.monitoring.disc_temperature import (
    AMBIENT_ERROR,
    AMBIENT_UNKNOWN,
    UNKNOWN_EXCESS,
    heat_widening,
    update_discs,
)
from ecu.algorithm.step import new_state, step
from ecu.contract.records import OUTPUTS
from ecu.contract.signals import CALLIPER_PRESSURE, CORNERS, HOLDING, INPUT, OBSERVING, OUTPUT
from ecu.jit import kernel
from ecu.recording.learned_range import DISC_EXCESS_LIMIT

AIR = 20.0  # degC
RADIUS = 0.36  # m
TORQUE = np.array([800.0, 800.0, 400.0, 400.0])  # N m


class Discs:
    """The model alone, under torques and speeds that are imposed; the discs start cold and known."""

    def __init__(self, params, feed) -> None:
        self.params, self.feed, self.p = params, feed, params[0]
        self.inputs = feed(ambient_temperature=AIR, rain=0.0, calliper_pressure=0.0)
        self.s = new_state(params)[0]
        self.s["estimate"]["mu"], self.s["estimate"]["sigma"] = 0.45, 0.0
        self.s["estimate"]["mode"] = HOLDING
        self.s["estimate"]["load"] = 5000.0
        self.d = self.s["discs"]
        self.d["excess"] = self.d["sigma_start"] = 0.0

    def go(self, seconds: float, torque=0.0, speed: float = 0.0, force: float = 0.0, dt: float = 0.01):
        """Return temperatures [degC], shape (4,), after `seconds` of constant torque and speed."""
        self.s["estimate"]["brake_torque"] = torque
        self.s["application"]["braking"] = np.any(np.asarray(torque) > 0)
        self.s["estimate"]["speed"], self.s["estimate"]["tyre_force"] = speed, force
        self.feed(self.inputs, wheel_speed=speed / RADIUS)
        s, cycles = self.s, round(seconds / dt)
        estimate, application = s["estimate"], s["application"]
        update_cycles(self.p, self.d, s["learned"], self.inputs, estimate, application, dt, cycles)
        return self.d["temperature"].copy()

    def step(self, dt: float = 0.01) -> None:
        """Run one cycle with the inputs and the estimate as they are."""
        s = self.s
        update_discs(self.p, self.d, s["learned"], self.inputs[0], s["estimate"], s["application"], dt)

    def rate(self, speed: float, wet: str = ""):
        """Return delta [1/s], shape (4,); `wet`: "_wet" in rain."""
        return self.p[f"disc_cooling{wet}"] + self.p[f"disc_cooling_by_speed{wet}"] * speed

    def silence(self, name: str) -> None:
        """Let a signal die."""
        self.inputs[0]["verdict"][INPUT[name]] = 0


@kernel
def update_cycles(params, discs, learned, inputs, estimate, application, dt, cycles):
    for _ in range(cycles):
        update_discs(params, discs, learned, inputs[0], estimate, application, dt)


@pytest.fixture
def discs(params, feed) -> Discs:
    return Discs(params, feed)


# Closed forms


@pytest.mark.parametrize(("speed", "seconds"), [(10.0, 5.0), (30.0, 5.0), (30.0, 300.0)])
def test_constant_power_heats_towards_power_over_cooling(discs: Discs, speed, seconds) -> None:
    found = discs.go(seconds, TORQUE, speed)
    rate = discs.rate(speed)
    final = discs.p["disc_heating"] * TORQUE * speed / RADIUS / rate
    assert found - AIR == pytest.approx(final * (1.0 - np.exp(-rate * seconds)), rel=1e-9)


@pytest.mark.parametrize("kmh", [0.0, 30.0, 100.0, 130.0])
@pytest.mark.parametrize(("rain", "wet"), [(0.0, ""), (1.0, "_wet")])
@pytest.mark.parametrize("dt", [0.01, 0.05])
def test_a_disc_cools_exponentially_at_constant_speed(discs: Discs, kmh, rain, wet, dt) -> None:
    discs.feed(discs.inputs, rain=rain)
    discs.d["excess"] = 380.0
    found = discs.go(60.0, speed=kmh / 3.6, dt=dt)
    assert found - AIR == pytest.approx(380.0 * np.exp(-60.0 * discs.rate(kmh / 3.6, wet)), rel=1e-9)


def test_from_400_to_100_degrees_at_100_km_h_takes_minutes(discs: Discs) -> None:
    """With a tenth of the printed delta_1: 361 s for brake A, 418 s for brake B; as printed one minute."""
    discs.d["excess"] = 400.0 - AIR
    assert discs.go(361.0, speed=100.0 / 3.6)[:2] == pytest.approx([100.0, 100.0], abs=0.5)
    assert discs.go(418.0 - 361.0, speed=100.0 / 3.6)[2:] == pytest.approx([100.0, 100.0], abs=0.5)


def test_heat_put_in_is_stored_or_carried_off(discs: Discs) -> None:
    random = np.random.default_rng(1)
    taken, carried = np.zeros(4), np.zeros(4)
    for _ in range(300):
        torque, speed = TORQUE * random.uniform(0.0, 1.0), random.uniform(5.0, 40.0)
        before = discs.d["excess"].copy()
        discs.go(0.1, torque, speed)
        taken += 0.1 * torque * speed / RADIUS
        carried += 0.1 * discs.rate(speed) * 0.5 * (before + discs.d["excess"]) / discs.p["disc_heating"]
    stored = discs.d["excess"] / discs.p["disc_heating"]
    assert stored + carried == pytest.approx(taken, rel=1e-5)
    assert (carried > 0.02 * taken).all()


# Standard deviation


def cycle_of_stops(discs: Discs) -> np.ndarray:
    for _ in range(5):
        discs.go(5.0, TORQUE, 20.0, dt=0.05)
        discs.go(60.0, speed=25.0, dt=0.05)
    return discs.d["excess"].copy()


@pytest.mark.parametrize(
    ("cause", "parameters", "share"),
    [
        ("sigma_heating", ["disc_heating"], 0.10),
        ("sigma_cooling", ["disc_cooling", "disc_cooling_by_speed"], 0.20),
    ],
)
def test_a_part_of_sigma_is_what_a_wrong_parameter_does(params, feed, cause, parameters, share) -> None:
    """Central difference of the whole drive over the parameter, beside the part that the model carries."""
    discs = Discs(params, feed)
    cycle_of_stops(discs)
    found, step_by = discs.d[cause].copy(), 1e-3
    ends = []
    for sign in (-1.0, 1.0):
        other = params.copy()
        for name in parameters:
            other[name] *= 1.0 + sign * step_by
        ends.append(cycle_of_stops(Discs(other, feed)))
    slope = np.abs(ends[1] - ends[0]) / (2.0 * step_by)
    print(f"{cause}: {np.round(found, 2)} K of {np.round(discs.d['excess'], 1)} K")
    assert found == pytest.approx(share * slope, rel=1e-3)


def test_friction_that_is_not_known_is_an_error_of_the_heat(discs: Discs) -> None:
    discs.s["estimate"]["sigma"] = 0.15 * 0.45
    discs.go(5.0, TORQUE, 20.0)
    assert discs.d["sigma_heating"] / discs.d["excess"] == pytest.approx(np.full(4, math.hypot(0.10, 0.15)))


def test_braking_widens_and_rest_narrows_to_the_error_of_the_air(discs: Discs) -> None:
    discs.go(1.0)
    sigmas = [discs.d["sigma"].copy()]
    for _ in range(3):
        discs.go(10.0, TORQUE, 25.0)
        sigmas.append(discs.d["sigma"].copy())
    assert all((a < b).all() for a, b in itertools.pairwise(sigmas))
    found = discs.go(4 * 3600.0, dt=1.0)
    assert found == pytest.approx(np.full(4, AIR), abs=0.1)
    assert discs.d["sigma"] == pytest.approx(np.full(4, AMBIENT_ERROR), abs=0.01)


# Start and restart


def test_a_first_start_is_somewhere_between_the_air_and_hot(params, feed) -> None:
    disc = new_state(params)[0]["discs"]
    drawn = np.random.default_rng(1).uniform(0.0, UNKNOWN_EXCESS, 100_000)
    assert disc["excess"] == pytest.approx(np.full(4, drawn.mean()), rel=0.01)
    assert disc["sigma_start"] == pytest.approx(np.full(4, drawn.std()), rel=0.01)


@pytest.mark.parametrize("rest_s", [0.0, 300.0, 3600.0, 8 * 3600.0])
def test_after_a_restart_every_rest_since_the_last_braking_is_inside_the_band(params, feed, rest_s) -> None:
    discs = Discs(params, feed)
    discs.go(20.0, TORQUE, 25.0)
    discs.s["application"]["ended"] = 1
    discs.go(0.01)
    discs.s["application"]["ended"] = 0
    learned = np.array([discs.s["learned"]])
    true = discs.go(rest_s, dt=1.0) if rest_s else discs.d["temperature"].copy()
    again = Discs(params, feed)
    again.s = new_state(params, learned)[0]
    again.d = again.s["discs"]
    again.s["estimate"]["mode"] = HOLDING
    found = again.go(0.01)
    off = (found - true) / again.d["sigma"]
    print(f"rest {rest_s:.0f} s: true {np.round(true)}, found {np.round(found)}, {np.round(off, 2)} sigma")
    assert np.abs(off).max() < 2.0


def test_restarts_alone_make_the_disc_no_hotter(discs: Discs) -> None:
    """What is saved is the upper edge: without heat between two starts it stays below the one before."""
    discs.s["application"]["ended"] = 1
    for _ in range(5):
        before = discs.s["learned"]["disc_excess"].copy()
        discs.d["excess"], discs.d["sigma_start"] = before / 2, before / math.sqrt(12)
        discs.go(0.01)
        assert (discs.s["learned"]["disc_excess"] < before + 2.0).all()


def test_what_is_stored_is_never_hotter_than_a_disc_can_be(discs: Discs) -> None:
    """A store refuses the whole record otherwise, friction and wear with it."""
    discs.s["application"]["ended"] = 1
    discs.d["excess"], discs.d["sigma_heating"] = 900.0, [100.0, 300.0, 1e4, 1e12]
    discs.go(0.01)
    stored = discs.s["learned"]["disc_excess"]
    assert stored[0] == pytest.approx(900 + math.sqrt(3) * discs.d["sigma"][0], abs=0.1)
    assert (stored[1:] == 1200.0).all()
    assert stored.max() <= DISC_EXCESS_LIMIT


# Lost signals, air, noise


def test_silent_air_is_the_configured_or_the_last_and_less_certain(params, feed) -> None:
    discs = Discs(params, feed)
    discs.silence("ambient_temperature")
    assert discs.go(0.01) == pytest.approx(np.full(4, params["ambient_temperature"][0]))
    assert discs.d["sigma"] == pytest.approx(np.full(4, AMBIENT_UNKNOWN))
    heard = Discs(params, feed)
    feed(heard.inputs, ambient_temperature=-10.0)
    heard.go(0.01)
    heard.silence("ambient_temperature")
    assert heard.go(0.01) == pytest.approx(np.full(4, -10.0))
    assert heard.d["sigma"] == pytest.approx(np.full(4, AMBIENT_UNKNOWN))


@pytest.mark.parametrize("rain", ["wet", "unknown"])
def test_cooling_is_less_certain_in_rain_or_where_nobody_tells(params, feed, rain) -> None:
    dry, other = Discs(params, feed), Discs(params, feed)
    if rain == "wet":
        feed(other.inputs, rain=1.0)
    else:
        other.silence("rain")
    for disc in (dry, other):
        disc.d["excess"] = 200.0
        disc.go(60.0, speed=30.0)
    assert (other.d["sigma_cooling"] > 1.5 * dry.d["sigma_cooling"]).all()


def test_a_disc_is_never_colder_than_the_air(discs: Discs) -> None:
    random = np.random.default_rng(2)
    for _ in range(500):
        air = random.uniform(-40.0, 50.0)
        discs.feed(discs.inputs, ambient_temperature=air, rain=float(random.random() < 0.5))
        found = discs.go(
            1.0, TORQUE * max(random.uniform(-3.0, 1.0), 0.0), random.uniform(-5.0, 60.0), dt=0.5
        )
        assert (found >= air).all()


def test_noise_of_released_brakes_does_not_heat(discs: Discs) -> None:
    """Cut off at zero, 1.8 bar of noise would be a torque of 9 N m: 20 K after three minutes of motorway."""
    random, s = np.random.default_rng(3), discs.s
    s["estimate"]["speed"] = 30.0
    for _ in range(20_000):
        discs.feed(discs.inputs, calliper_pressure=0.5 + 1.8 * random.standard_normal(4), wheel_speed=80.0)
        update_application(discs.p, s["application"], discs.inputs[0], np.zeros(4), 0.01)
        update_pressure(discs.p, s["friction"], s["estimate"]["mu"], np.zeros(4), discs.inputs[0], 0.01)
        s["estimate"]["brake_torque"] = s["friction"]["torque"]
        discs.step()
    assert (discs.d["excess"] < 0.5).all()


def test_a_lost_pressure_counts_the_deceleration_as_heat_and_as_error(params, feed) -> None:
    whole, lost = Discs(params, feed), Discs(params, feed)
    speed = 25.0
    force = -float(TORQUE.sum()) / RADIUS  # the torques are all that slows the car
    for name in (f"calliper_pressure_{c}" for c in CORNERS):
        lost.silence(name)
    true = whole.go(5.0, TORQUE, speed, force)
    found = lost.go(5.0, 0.0, speed, force)
    assert np.sum((found - AIR) / params["disc_heating"]) == pytest.approx(
        np.sum((true - AIR) / params["disc_heating"]), rel=0.03
    )
    assert (np.abs(found - true) < 2.0 * lost.d["sigma"]).all()
    assert (lost.d["sigma"] > 3.0 * whole.d["sigma"]).all()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["wheel_speed", "calliper_pressure", "ambient_temperature", "rain"])
def test_a_value_that_is_not_finite_leaves_no_trace(params, feed, name, value) -> None:
    clean, dirty = Discs(params, feed), Discs(params, feed)
    for disc in (clean, dirty):
        disc.go(2.0, TORQUE, 20.0)
    good = dirty.inputs[0]["value"].copy()
    feed(dirty.inputs, **{name: value})
    dirty.s["estimate"]["tyre_force"] = -6000.0
    for _ in range(5):
        dirty.step()
        assert np.isfinite(dirty.d["temperature"]).all()
        assert np.isfinite(dirty.d["sigma"]).all()
    dirty.inputs[0]["value"] = good
    expected, found = clean.go(1.05, TORQUE, 20.0), dirty.go(1.0, TORQUE, 20.0)
    assert found == pytest.approx(expected, abs=0.5)


def test_without_a_pressure_signal_there_is_no_temperature(params, feed) -> None:
    params[0]["mapped"][CALLIPER_PRESSURE] = 0
    outputs = np.zeros(1, OUTPUTS)
    step(params, new_state(params), feed(calliper_pressure=0.0), outputs)
    row = outputs.view(np.float64)
    for name in ("disc_temperature", "sigma_disc_temperature"):
        assert [math.isnan(row[OUTPUT[f"{name}_{c}"]]) for c in CORNERS] == [True, False, False, False]


@pytest.mark.parametrize(("excess", "expected"), [(0.0, 0.04), (100.0, 0.0), (200.0, 0.04), (350.0, 0.10)])
def test_friction_gets_less_certain_by_4_percent_per_100_kelvin_off(discs, excess, expected) -> None:
    discs.s["estimate"]["mode"] = OBSERVING
    discs.d["excess"] = 100.0
    discs.go(0.001, dt=0.001)
    discs.s["estimate"]["mode"] = HOLDING
    discs.d["excess"] = excess
    discs.go(0.001, dt=0.001)
    assert heat_widening(discs.d, 0) == pytest.approx(expected, abs=1e-5)


def test_a_recorded_thermocouple_tells_the_start_and_nothing_after_it(discs) -> None:
    """Cold after a night: within a few kelvin at once, where half of 200 K was assumed for a quarter hour."""
    discs.d["excess"], discs.d["sigma_start"] = 0.5 * UNKNOWN_EXCESS, 0.5 * UNKNOWN_EXCESS / math.sqrt(3.0)
    place = INPUT["disc_temperature_measured_fl"]
    discs.inputs[0]["verdict"][place : place + 4] = discs.inputs[0]["verdict"][0]
    discs.feed(discs.inputs, disc_temperature_measured=AIR + 4.0)
    discs.step()
    assert discs.d["temperature"] == pytest.approx(AIR + 4.0, abs=0.1)
    assert (discs.d["sigma"] < 7.0).all()
    discs.feed(discs.inputs, disc_temperature_measured=300.0)
    discs.step()
    assert discs.d["temperature"] == pytest.approx(AIR + 4.0, abs=0.1)
