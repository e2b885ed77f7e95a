"""Wheel speeds and calliper pressures that cannot be: what is said, and after how long."""

from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.plausibility import (
    PLAUSIBILITY_STATE,
    watch_pressures,
    watch_wheels,
    wheel_speed_implausible,
)
from ecu.algorithm.monitoring.witness import WITNESS_STATE, begin_watch
from ecu.contract.signals import ACCELERATOR_POSITION, CALLIPER_PRESSURE, MOTOR_TORQUE, WHEEL_SPEED

WITNESS = np.zeros(1, WITNESS_STATE)[0]  # what is published does not matter here

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
    ("no faster than where it can be judged", 1.30, 800.0, 0.0, 5.0, False),
    ("not braked", 1.30, 20.0, 0.0, 20.0, False),
    ("hardly braked", 1.30, 100.0, 0.0, 20.0, False),
    ("braked just enough to tell", 1.30, 101.0, 0.0, 20.0, True),
]


def estimated(speed: float, torque: float):
    """`ESTIMATE` of a car that drives straight [m/s], brake torque of its linings [N m]."""
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["speed"], estimate["brake_torque"] = speed, torque
    return estimate


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
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    inputs = feed()
    inputs[0]["value"][WHEEL_SPEED : WHEEL_SPEED + 4] = 0.98 * speed / params[0]["wheel_radius"]
    inputs[0]["value"][WHEEL_SPEED + wheel] = turns * speed / params[0]["wheel_radius"][wheel]
    inputs[0]["value"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = motor
    said = [
        wheel_speed_implausible(params[0], state, WITNESS, inputs[0], estimated(speed, torque), 0.01)
        for _ in range(50)
    ]
    assert any(said) == implausible
    if implausible:
        assert said.index(True) == pytest.approx(30, abs=1)


def fallen(speeds: list[float], torque: float, params, feed, period: float = 0.01) -> list[bool]:
    """Wheel fl at each sample [rad/s] of a car at the first one's speed that brakes with `torque` [N m]."""
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    ground, said = speeds[0] * params[0]["wheel_radius"][0], []
    for speed in speeds:
        inputs = feed(wheel_speed=[speed, *[speeds[0]] * 3])
        watch_wheels(params[0], state, WITNESS, inputs[0], estimated(ground, torque), period)
        said.append(bool(state["fell"][0]))
        assert not state["fell"][1:].any()
    return said


def locking(torque: float, inertia: float, period: float = 0.01) -> list[float]:
    """A wheel of 60 rad/s whose road has no grip: T / I, no tyre holds it."""
    return [max(60.0 - torque / inertia * period * k, 0.0) for k in range(30)]


@pytest.mark.parametrize("torque", [100.0, 500.0, 1500.0, 4000.0])
@pytest.mark.parametrize("period", [0.01, 0.02, 0.05])
def test_no_wheel_that_its_brake_locks_is_left_out(params, feed, torque: float, period: float) -> None:
    speeds = locking(torque, params[0]["wheel_inertia"][0], period)
    assert speeds[-1] < 60.0
    assert not any(fallen(speeds, torque, params, feed, period))


def test_a_wheel_whose_wire_breaks_is_left_out_until_it_agrees_again(params, feed) -> None:
    speeds = [60.0] * 5 + [0.0] * 50 + [30.0] * 5 + [59.0] * 5
    assert fallen(speeds, 800.0, params, feed) == [False] * 5 + [True] * 55 + [False] * 5
    assert fallen([60.0, 0.0, 60.0, 60.0], 0.0, params, feed) == [False, True, False, False]


@pytest.mark.parametrize("stuck", [1, 2])
@pytest.mark.parametrize("car", [0.93, 1.0], ids=["speed 7 % low", "speed right"])
def test_wheels_are_held_against_each_other_too(params, feed, stuck: int, car: float) -> None:
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    turns = np.array([1.2] * stuck + [0.99] * (4 - stuck)) * 20.0 / params[0]["wheel_radius"]
    sound = np.full(4, 0.99) * 20.0 / params[0]["wheel_radius"]
    for speeds, expected in ((sound, False), (turns, True)):
        said = [
            wheel_speed_implausible(
                params[0], state, WITNESS, feed(wheel_speed=speeds)[0], estimated(car * 20.0, 800.0), 0.01
            )
            for _ in range(50)
        ]
        assert any(said) == expected


PRESSURES: list[tuple[str, list[float], list[float], dict[str, Any], bool]] = [
    # what, demanded [bar], measured [bar], beside it, does not follow
    ("all follow", [30, 30, 12, 12], [30, 30, 12, 12], {}, False),
    ("as far as the model goes", [60, 60, 20, 20], [48, 72, 24, 16], {}, False),
    ("one keeps its value", [0, 0, 0, 0], [30, 0, 0, 0], {}, True),
    ("one does not rise", [30, 30, 12, 12], [30, 0, 12, 12], {}, True),
    ("an axle does not rise", [30, 30, 12, 12], [0, 0, 12, 12], {}, False),
    ("the car's own hydraulics brake", [30, 30, 30, 30], [0, 0, 0, 0], {}, False),
    ("a shadow", [30, 30, 12, 12], [30, 0, 12, 12], {"sent": 0}, False),
    ("an ABS works", [30, 30, 12, 12], [30, 0, 12, 12], {"abs_active": 1.0}, False),
    ("ESP works", [0, 0, 0, 0], [30, 0, 0, 0], {"esp_active": 1.0}, False),
    ("the sensor is lost", [30, 30, 12, 12], [30, 0, 12, 12], {"lost": 1}, False),
    ("an ABS that is half said to work", [30, 30, 12, 12], [30, 0, 12, 12], {"abs_active": 0.5}, True),
    ("an ABS that is rather said to work", [30, 30, 12, 12], [30, 0, 12, 12], {"abs_active": 0.51}, False),
]


@pytest.mark.parametrize(
    ("what", "demanded", "measured", "beside", "apart"), PRESSURES, ids=lambda value: str(value)[:24]
)
def test_a_pressure_follows_its_demand_if_any_does(
    feed, what: str, demanded: list[float], measured: list[float], beside: dict[str, Any], apart: bool
) -> None:
    rng, zero = np.random.default_rng(3), np.full(4, 0.7)
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["sent"] = beside.get("sent", 1)
    inputs = feed(**{name: value for name, value in beside.items() if name.endswith("active")})
    if "lost" in beside:
        inputs[0]["verdict"][CALLIPER_PRESSURE + 1] = 0
    said = []
    for _ in range(60):
        feed(inputs, calliper_pressure=measured + zero + rng.normal(0.0, 1.8, 4))
        watch_pressures(state, inputs[0], np.array(demanded, float), zero, 0.01)
        said.append(bool(state["pressure"]))
    assert any(said) == apart
    if apart:
        assert said.index(True) == pytest.approx(30, abs=1)


def test_noise_of_6_bar_is_no_pressure_that_does_not_follow(feed) -> None:
    rng, state = np.random.default_rng(3), np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["sent"], inputs = 1, feed()
    for _ in range(20_000):
        feed(inputs, calliper_pressure=30.0 + rng.normal(0.0, 6.0, 4))
        watch_pressures(state, inputs[0], np.full(4, 30.0), np.zeros(4), 0.01)
        assert not state["pressure"]


def test_a_pressure_that_follows_again_is_believed_again(feed) -> None:
    state, inputs = np.zeros(1, PLAUSIBILITY_STATE)[0], feed()
    state["sent"] = 1
    said = []
    for k in range(1000):
        feed(inputs, calliper_pressure=[0.0 if k < 600 else 30.0, 30.0, 12.0, 12.0])
        watch_pressures(state, inputs[0], np.array([30.0, 30.0, 12.0, 12.0]), np.zeros(4), 0.01)
        said.append(bool(state["pressure"]))
    assert said[599]
    assert not any(said[632:])


SHAKING = [
    # case, rear wheels over ground, how they shake [m/s], accelerator [%], motor [N m], named
    ("spin and shake under the engine", 1.15, 1.0, 60.0, 0.0, False),
    ("under motors, accelerator unknown", 1.15, 1.0, None, -400.0, False),
    ("shake while nobody drives", 1.15, 1.0, 0.0, 0.0, True),
    ("shake, driven, at the car's speed", 1.0, 0.3, 60.0, 0.0, True),
    ("driven, and quiet", 1.0, 0.02, 60.0, 0.0, False),
]


@pytest.mark.parametrize(
    ("case", "turns", "shake", "accelerator", "motor", "named"), SHAKING, ids=[row[0] for row in SHAKING]
)
def test_wheels_that_spin_shake_and_their_sensors_are_sound(
    params, feed, case, turns, shake, accelerator, motor, named
) -> None:
    state, witness = np.zeros(1, PLAUSIBILITY_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
    radius, speed = params[0]["wheel_radius"], 13.0
    random = np.random.default_rng(0)
    for _ in range(200):
        rear = turns * speed + shake * random.standard_normal(2)
        ground = np.array([speed, speed, *rear]) + 0.01 * random.standard_normal(4)
        inputs = feed(wheel_speed=ground / radius, motor_torque=[0.0, 0.0, motor, motor])
        inputs[0]["value"][ACCELERATOR_POSITION] = accelerator or 0.0
        inputs[0]["verdict"][ACCELERATOR_POSITION] *= accelerator is not None
        watch_wheels(params[0], state, witness, inputs[0], estimated(speed, 0.0), 0.01)
    assert bool(state["noisy"].any()) == named, case
    assert bool(witness["rejected"].any()) == named


def test_a_lost_wheel_does_not_count_among_the_others(params, feed) -> None:
    """Three wheels 8 % fast are the car's speed that is wrong; a lost one that reads 0 does not hide that."""
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    inputs = feed(wheel_speed=np.array([1.08, 1.08, 1.08, 0.0]) * 20.0 / params[0]["wheel_radius"])
    inputs[0]["verdict"][WHEEL_SPEED + 3] = 0
    for _ in range(60):
        assert not wheel_speed_implausible(params[0], state, WITNESS, inputs[0], estimated(20.0, 800.0), 0.01)


@pytest.mark.parametrize(
    ("age", "left_out"),
    [(0.09, True), (0.0999, True), (0.1, False), (0.105, False), (0.2, False)],
)
def test_a_sample_is_compared_with_one_that_is_younger_than_0_1_s(params, feed, age, left_out) -> None:
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["omega"], ground = 60.0, 60.0 * float(params[0]["wheel_radius"][0])
    watch_wheels(params[0], state, WITNESS, feed(wheel_speed=0.0)[0], estimated(ground, 0.0), age)
    assert bool(state["fell"][0]) == left_out


def sample(params, feed, corner: int, omega: float, state=None, torque=0.0, age=0.01, ground=None, **beside):
    """Take a sample of one wheel [rad/s] that turned at 60 before; return the state."""
    if state is None:
        state = np.zeros(1, PLAUSIBILITY_STATE)[0]
        state["omega"] = 60.0
    wheels = np.full(4, 60.0)
    wheels[corner] = omega
    inputs = feed(wheel_speed=wheels)
    inputs[0]["value"][MOTOR_TORQUE + corner] = beside.get("motor", 0.0)
    inputs[0]["new"][WHEEL_SPEED + corner] = beside.get("new", 1)
    if beside.get("pressure_lost"):
        inputs[0]["verdict"][CALLIPER_PRESSURE + corner] = 0
    speed = 60.0 * float(params[0]["wheel_radius"][0]) if ground is None else ground
    watch_wheels(params[0], state, WITNESS, inputs[0], estimated(speed, torque), age)
    return state


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize(("torque", "motor"), [(0.0, 0.0), (800.0, 0.0), (500.0, 300.0), (500.0, -300.0)])
@pytest.mark.parametrize("age", [0.01, 0.02])
def test_a_wheel_falls_by_5_rad_s_and_1_6_times_what_its_brake_does_at_most(
    params, feed, corner: int, torque: float, motor: float, age: float
) -> None:
    free = (torque + abs(motor)) / params[0]["wheel_inertia"][corner] * age
    for beyond, fell in ((-0.1, 0), (0.0, 0), (0.1, 1)):
        if beyond == 0.0 and free > 0.0:
            continue  # rounding decides
        omega = 60.0 - (5.0 + 1.6 * free + beyond)
        state = sample(params, feed, corner, omega, torque=torque, age=age, motor=motor)
        assert state["fell"].tolist() == [fell * (i == corner) for i in range(4)]


@pytest.mark.parametrize("corner", range(4))
def test_what_is_no_new_sample_or_has_no_pressure_beside_it_is_not_judged(params, feed, corner: int) -> None:
    assert not sample(params, feed, corner, 0.0, pressure_lost=True)["fell"].any()
    late = sample(params, feed, corner, 0.0, new=0)
    assert not late["fell"].any()
    assert (late["omega"][corner], late["age_s"][corner]) == (60.0, 0.01)


@pytest.mark.parametrize(
    ("case", "turns", "ground", "fell"),
    [
        ("5 % off the car", 0.95, None, 0),
        ("7 % off the car", 0.93, None, 1),
        ("the car stands", 0.0, 0.05, 0),
        ("the car hardly moves", 0.0, 0.1, 1),
    ],
)
def test_a_wheel_is_believed_again_where_it_agrees_with_the_car(
    params, feed, case, turns, ground, fell
) -> None:
    state = sample(params, feed, 1, 0.0)
    assert state["fell"].tolist() == [0, 1, 0, 0]
    state = sample(params, feed, 1, 60.0 * turns, state, ground=ground)
    assert state["fell"][1] == fell, case


@pytest.mark.parametrize("fast", range(4))
@pytest.mark.parametrize(
    ("case", "lost", "speed", "implausible"),
    [
        ("6 m/s", (), 6.0, True),
        ("4.5 m/s", (), 4.5, False),
        ("one other wheel is left", (1, 2), 20.0, True),
        ("no other wheel is left", (1, 2, 3), 20.0, False),
        ("itself is lost", (0,), 20.0, False),
    ],
)
def test_a_fast_wheel_beside_the_others(params, feed, fast, case, lost, speed, implausible) -> None:
    """`lost`: counted from the fast wheel on."""
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    omega = speed / params[0]["wheel_radius"]
    omega[fast] *= 1.2
    inputs = feed(wheel_speed=omega)
    for other in lost:
        inputs[0]["verdict"][WHEEL_SPEED + (fast + other) % 4] = 0
    said = False
    for _ in range(40):
        said = wheel_speed_implausible(params[0], state, WITNESS, inputs[0], estimated(speed, 800.0), 0.01)
    assert bool(said) == implausible, case


@pytest.mark.parametrize(
    ("expected", "off", "others", "beside", "apart"),
    [
        # bar; too far is 8 bar and a fifth of the pressure, three quarters of that follow
        (0.0, 8.0, 0.0, {}, 0),
        (0.0, 8.5, 0.0, {}, 1),
        (0.0, -8.5, 0.0, {}, 1),
        (30.0, 13.5, 0.0, {}, 0),
        (30.0, 14.5, 0.0, {}, 1),
        (30.0, -14.5, 0.0, {}, 1),
        (30.0, 20.0, 10.0, {}, 1),
        (30.0, 20.0, 11.0, {}, 0),
        (0.0, 20.0, 5.9, {}, 1),
        (0.0, 20.0, 6.0, {}, 0),
        (30.0, 20.0, 0.0, {"esp_active": 0.5}, 1),
    ],
)
def test_how_far_apart_is_too_far(feed, expected, off, others, beside, apart) -> None:
    state, zero = np.zeros(1, PLAUSIBILITY_STATE)[0], np.full(4, 0.5)
    state["sent"] = 1
    inputs = feed(**beside, calliper_pressure=expected + zero + np.array([others, off, others, others]))
    for _ in range(40):
        watch_pressures(state, inputs[0], np.full(4, expected), zero, 0.01)
    assert state["pressure"] == apart


def test_what_lasts_0_3_s_is_not_said_yet(params, feed) -> None:
    """Cycles of 0.15 s: the second one makes just 0.3 s of it."""
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["sent"] = 1
    turns = np.array([1.2, 0.99, 0.99, 0.99]) * 20.0 / params[0]["wheel_radius"]
    inputs = feed(wheel_speed=turns, calliper_pressure=[30.0, 0.0, 0.0, 0.0])
    wheels, pressures = [], []
    for _ in range(3):
        wheels.append(
            wheel_speed_implausible(params[0], state, WITNESS, inputs[0], estimated(20.0, 800.0), 0.15)
        )
        watch_pressures(state, inputs[0], np.zeros(4), np.zeros(4), 0.15)
        pressures.append(bool(state["pressure"]))
    assert wheels == pressures == [False, False, True]


JITTERS = [
    # noise over the configured one, jumps [rad/s] each second, seconds, left out
    (1.0, 0.0, 20.0, False),
    (4.0, 0.0, 5.0, False),
    (10.0, 0.0, 1.5, True),
    (10.0, 0.0, 0.3, False),
    (1.0, 60.0, 20.0, False),
]


@pytest.mark.parametrize(("noise", "jump", "seconds", "left_out"), JITTERS)
def test_a_wheel_that_is_far_noisier_than_configured_is_left_out(
    params, feed, noise: float, jump: float, seconds: float, left_out: bool
) -> None:
    """From the first sample on; a sample lost or wrong now and then is no noise."""
    state, witness = np.zeros(1, PLAUSIBILITY_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
    inputs, random = feed(), np.random.default_rng(0)
    sigma, radius = params[0]["sigma_wheel_speed"], params[0]["wheel_radius"]
    for k in range(round(100 * seconds)):
        wrong = jump if k % 100 == 50 else 0.0
        omega = 20.0 / radius + noise * sigma * random.standard_normal(4) + wrong
        feed(inputs, wheel_speed=omega, motor_torque=0.0, calliper_pressure=0.0)
        watch_wheels(params[0], state, witness, inputs[0], estimated(20.0, 0.0), 0.01)
    assert (witness["rejected"][WHEEL_SPEED : WHEEL_SPEED + 4] == left_out).all()


def published(witness) -> dict[int, tuple[float, float]]:
    """Return innovation and sigma [rad/s] of the wheels of which something was published in this cycle."""
    row = witness["published"]
    compared = [i for i in range(4) if row["judged_s"][WHEEL_SPEED + i] == 0.0]
    return {i: (row["innovation"][WHEEL_SPEED + i], row["sigma"][WHEEL_SPEED + i]) for i in compared}


FAST = [
    # case, wheels over ground from the fast one on, lost, speed [m/s], brake torque [N m], excess published
    ("beside wheels that roll", (1.03, 1.0, 1.0, 1.0), (), 20.0, 800.0, 0.03),
    ("beside wheels that slip: over the ground", (1.03, 0.9, 0.9, 0.9), (), 20.0, 800.0, 0.03),
    ("beside wheels faster than the ground", (1.08, 1.01, 1.02, 1.03), (), 20.0, 800.0, 1.08 / 1.02 - 1.0),
    ("beside one that is left", (1.06, 1.02, 1.3, 1.3), (2, 3), 20.0, 800.0, 1.06 / 1.02 - 1.0),
    ("beside none", (1.06, 1.02, 1.02, 1.02), (1, 2, 3), 20.0, 800.0, None),
    ("lost itself", (1.06, 0.9, 0.9, 0.9), (0,), 20.0, 800.0, None),
    ("as fast as the others", (1.01, 1.01, 1.01, 1.01), (), 20.0, 800.0, None),
    ("slower", (0.97, 0.9, 0.9, 0.9), (), 20.0, 800.0, None),
    ("too slow to tell", (1.03, 0.9, 0.9, 0.9), (), 3.0, 800.0, None),
    ("not braked", (1.03, 0.9, 0.9, 0.9), (), 20.0, 50.0, None),
]


@pytest.mark.parametrize("fast", range(4))
@pytest.mark.parametrize(
    ("case", "turns", "lost", "speed", "torque", "excess"), FAST, ids=[row[0] for row in FAST]
)
def test_what_is_published_of_a_fast_wheel(
    params, feed, fast, case, turns, lost, speed, torque, excess
) -> None:
    """Excess over the ground and over the mean of the others, in rad/s; 5 % are three sigma."""
    state, witness = np.zeros(1, PLAUSIBILITY_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
    free = speed / params[0]["wheel_radius"]
    inputs = feed(wheel_speed=free * np.roll(turns, fast))
    for other in lost:
        inputs[0]["verdict"][WHEEL_SPEED + (fast + other) % 4] = 0
    begin_watch(witness, 0.01)
    with np.errstate(divide="raise", invalid="raise"):
        wheel_speed_implausible(params[0], state, witness, inputs[0], estimated(speed, torque), 0.01)
    found = published(witness)
    if excess is None:
        assert fast not in found, case
    else:
        assert found[fast] == pytest.approx((excess * free[fast], 0.05 * free[fast] / 3.0)), case


@pytest.mark.parametrize("corner", range(4))
def test_what_is_published_of_a_wheel_that_falls(params, feed, corner) -> None:
    """No brake makes it fall: 5 rad/s are three sigma."""
    witness, state = np.zeros(1, WITNESS_STATE)[0], np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["omega"], omega = 60.0, np.full(4, 60.0)
    omega[corner] = 57.0
    begin_watch(witness, 0.01)
    speed = 60.0 * float(params[0]["wheel_radius"][0])
    watch_wheels(params[0], state, witness, feed(wheel_speed=omega)[0], estimated(speed, 0.0), 0.01)
    assert published(witness) == {corner: pytest.approx((-3.0, 5.0 / 3.0))}


@pytest.mark.parametrize("late", [None, 0, 1, 2, 3])
def test_what_all_wheels_do_is_no_noise(params, feed, late) -> None:
    """What the middle two do on average is the car's; compared where all four samples have come."""
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["omega"] = 60.0
    inputs = feed(wheel_speed=[59.0, 58.0, 56.0, 52.0])
    if late is not None:
        inputs[0]["new"][WHEEL_SPEED + late] = 0
    watch_wheels(params[0], state, WITNESS, inputs[0], estimated(20.0, 800.0), 0.01)
    assert state["change"] == pytest.approx([2.0, 1.0, -1.0, -5.0] if late is None else np.zeros(4))


def test_a_single_jump_counts_as_thirty_sigma(params, feed) -> None:
    """Low-passed with 0.5 s: that is no noise of six."""
    state = np.zeros(1, PLAUSIBILITY_STATE)[0]
    state["omega"] = 60.0
    inputs = feed(wheel_speed=[120.0, 60.0, 60.0, 60.0])
    watch_wheels(params[0], state, WITNESS, inputs[0], estimated(20.0, 0.0), 0.01)
    expected = (1.0 - np.exp(-0.01 / 0.5)) * 30.0 * params[0]["sigma_wheel_speed"]
    assert state["jitter"] == pytest.approx([expected, 0.0, 0.0, 0.0])


NOISES = [
    # case, noisy and rejected before, sigmas of noise; noisy then, published
    ("quiet", 0, 0, 1.0, 0, False),
    ("noisy from now on", 0, 0, 7.0, 1, True),
    ("was noisy, not for long enough", 1, 0, 1.0, 0, True),
    ("left out, until it has been quiet for a second", 1, 1, 1.0, 1, True),
]


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize(
    ("case", "noisy", "rejected", "sigmas", "noisy_then", "judged"), NOISES, ids=[row[0] for row in NOISES]
)
def test_which_wheel_is_judged_by_its_noise(
    params, feed, corner, case, noisy, rejected, sigmas, noisy_then, judged
) -> None:
    state, witness = np.zeros(1, PLAUSIBILITY_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
    state["noisy"][corner], witness["rejected"][WHEEL_SPEED + corner] = noisy, rejected
    state["jitter"][corner] = sigmas * params[0]["sigma_wheel_speed"]
    inputs = feed()
    inputs[0]["new"][WHEEL_SPEED : WHEEL_SPEED + 4] = 0
    begin_watch(witness, 0.01)
    watch_wheels(params[0], state, witness, inputs[0], estimated(20.0, 0.0), 0.01)
    assert state["noisy"].tolist() == [noisy_then * (i == corner) for i in range(4)], case
    assert (corner in published(witness)) == judged
