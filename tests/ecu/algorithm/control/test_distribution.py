"""Torque per wheel: equal use of grip, (5.1), the trailing axle behind the other whatever the linings do."""

import math
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.control.distribution import (
    DISTRIBUTION_STATE,
    ELECTRONIC,
    FIXED,
    GRIP,
    IDEAL,
    LEAST_TRAILING,
    RELEASE_S,
    cap_trailing,
    distribute,
    front_share,
    watch_trailing,
)
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.vehicle import rolling_radius
from ecu.contract.signals import WHEEL_SPEED
from ecu.settings.config import load_config, new_params

G, DT = 9.81, 0.01
CONFIGS = Path(__file__).parents[4] / "config"


@pytest.fixture
def state():
    state = np.zeros(1, DISTRIBUTION_STATE)
    state["trailing"] = state["rolled"] = 1.0
    state["grip"] = GRIP
    return state


@pytest.mark.parametrize("z", [-0.6, -0.3, -0.1, 0.0, 0.1, 0.15, 0.3, 0.5, 0.8, 1.0])
def test_ideal_both_axles_use_the_same_share_of_their_grip(params, z: float) -> None:
    """Moments about the other axle's contact; z is negative where the car drives backwards."""
    p = params[0]
    share = front_share(p, z * G)
    weight, length, h = p["mass"] * G, p["wheelbase"], p["cog_height"]
    front_load = weight * (p["rear_axle"] + z * h) / length
    rear_load = weight * (p["front_axle"] - z * h) / length
    front, rear = share * z * weight / front_load, (1 - share) * z * weight / rear_load
    assert front == pytest.approx(z)
    assert rear == pytest.approx(z)


# The SUV's ideal share is 0.520 + 0.244 z: it passes 0.65 at z = 0.534, 5.2 m/s^2.
SHARES = [
    # distribution, front_share, z, share
    (IDEAL, 0.0, 0.0, 0.5197),
    (IDEAL, 0.0, 0.8, 0.7148),
    (IDEAL, 0.0, 3.0, 1.0),
    (FIXED, 0.65, 0.1, 0.65),
    (FIXED, 0.65, 0.8, 0.65),
    (ELECTRONIC, 0.65, 0.1, 0.65),
    (ELECTRONIC, 0.65, 0.53, 0.65),
    (ELECTRONIC, 0.65, 0.54, 0.6514),
    (ELECTRONIC, 0.65, 0.8, 0.7148),
    # Backwards the front axle trails: the ideal share falls with z and passes 0.45 at z = -0.287.
    (IDEAL, 0.0, -0.3, 0.4466),
    (IDEAL, 0.0, -3.0, 0.0),
    (FIXED, 0.65, -0.3, 0.65),
    (ELECTRONIC, 0.45, -0.1, 0.45),
    (ELECTRONIC, 0.45, -0.4, 0.4222),
    (ELECTRONIC, 0.65, -0.1, 0.4953),
]


@pytest.mark.parametrize(("kind", "given", "z", "share"), SHARES)
def test_the_share_of_each_distribution(params, kind: int, given: float, z: float, share: float) -> None:
    params["distribution"], params["front_share"] = kind, given
    assert front_share(params[0], z * G) == pytest.approx(share, abs=1e-4)


@pytest.mark.parametrize("kind", [IDEAL, FIXED, ELECTRONIC])
@pytest.mark.parametrize("decel", [0.5, 2.0, 4.0, 8.0, 12.0])
def test_torques_add_up_to_the_force_that_is_asked_for(params, state, kind: int, decel: float) -> None:
    """(5.1): sum T_b / r = m a; nothing on either side of the car is larger than the other."""
    params["distribution"], params["front_share"] = kind, 0.65
    p = params[0]
    distribute(p, state[0], p["mass"], decel, False, DT)
    torques = state[0]["torque"]
    assert np.sum(torques / p["wheel_radius"]) == pytest.approx(p["mass"] * decel)
    assert torques[0] == torques[1] > torques[2] == torques[3] >= 0


@pytest.mark.parametrize("backwards", [False, True], ids=["forwards", "backwards"])
@pytest.mark.parametrize("mass", [1600.0, 2105.0, 2700.0])
def test_the_force_is_that_of_the_mass_as_it_is_known_now(
    params, state, mass: float, backwards: bool
) -> None:
    distribute(params[0], state[0], mass, 3.0, backwards, DT)
    assert np.sum(state[0]["torque"] / params[0]["wheel_radius"]) == pytest.approx(mass * 3.0)


@pytest.mark.parametrize("decel", [0.5, 2.0, 4.0, 6.0])
def test_backwards_every_wheel_uses_the_grip_that_its_axle_has(params, state, decel: float) -> None:
    """The front axle trails and is relieved by m a h / L: torque over radius and axle load is z at both."""
    p = params[0]
    distribute(p, state[0], p["mass"], decel, True, DT)
    force = state[0]["torque"] / p["wheel_radius"]
    shift = p["mass"] * decel * p["cog_height"] / p["wheelbase"]
    at_rest = p["mass"] * G * np.array([p["rear_axle"], p["front_axle"]]) / p["wheelbase"]
    used = [force[:2].sum() / (at_rest[0] - shift), force[2:].sum() / (at_rest[1] + shift)]
    assert used == pytest.approx([decel / G, decel / G])
    distribute(p, state[0], p["mass"], decel, False, DT)
    assert force[0] < state[0]["torque"][0] / p["wheel_radius"][0]


def test_no_request_is_no_torque_and_an_unknown_one_is_unknown(params, state) -> None:
    mass = params[0]["mass"]
    distribute(params[0], state[0], mass, 0.0, False, DT)
    assert state["torque"].tolist() == [[0.0] * 4]
    distribute(params[0], state[0], mass, math.nan, False, DT)
    assert np.isnan(state["torque"]).all()


@pytest.mark.parametrize(
    ("backwards", "trailing", "leading"),
    [
        pytest.param(False, slice(2, 4), slice(0, 2), id="forwards the rear trails"),
        pytest.param(True, slice(0, 2), slice(2, 4), id="backwards the front trails"),
    ],
)
def test_what_the_trailing_axle_is_not_left_the_leading_one_takes(
    params, state, backwards, trailing, leading
) -> None:
    """The sum of the forces stays; the leading axle's force over its load stays below `GRIP`."""
    p = params[0]
    distribute(p, state[0], p["mass"], 3.0, backwards, DT)
    before = state[0]["torque"].copy()
    state["trailing"] = 0.6
    distribute(p, state[0], p["mass"], 3.0, backwards, DT)
    after = state[0]["torque"]
    assert after[trailing] == pytest.approx(0.6 * before[trailing])
    assert np.sum(after / p["wheel_radius"]) == pytest.approx(p["mass"] * 3.0)
    shift = p["mass"] * 3.0 * p["cog_height"] / p["wheelbase"]
    at_rest = p["mass"] * G * (p["front_axle"] if backwards else p["rear_axle"]) / p["wheelbase"]
    assert np.sum(after[leading] / p["wheel_radius"][leading]) < GRIP * (at_rest + shift)


@pytest.mark.parametrize(("backwards", "arm"), [(False, "rear_axle"), (True, "front_axle")])
def test_beyond_the_grip_of_most_roads_the_leading_axle_takes_it_slowly(
    params, state, backwards, arm
) -> None:
    """At 7 m/s^2 the leading axle at once takes what is 0.6 of its load, then 0.5 of it a second more."""
    p, leading = params[0], slice(2, 4) if backwards else slice(0, 2)
    load = p["mass"] * (G * p[arm] + 7.0 * p["cog_height"]) / p["wheelbase"]
    distribute(p, state[0], p["mass"], 0.0, backwards, DT)
    distribute(p, state[0], p["mass"], 7.0, backwards, DT)
    alone = np.sum(state[0]["torque"][leading] / p["wheel_radius"][leading])
    assert alone / load == pytest.approx(7.0 / G)
    state["trailing"] = 0.6
    used = []
    for _ in range(60):
        distribute(p, state[0], p["mass"], 7.0, backwards, DT)
        used.append(np.sum(state[0]["torque"][leading] / p["wheel_radius"][leading]) / load)
    assert used[0] == pytest.approx(7.0 / G), "never less than its own share"
    assert used[40] == pytest.approx(GRIP + 41 * DT * 0.5)
    assert np.sum(state[0]["torque"] / p["wheel_radius"]) <= p["mass"] * 7.0 * (1 + 1e-12)


class Watch:
    """A car whose wheels slip as given; radii by their loads and errors."""

    def __init__(self, params, state, feed, learned: float = 2.0) -> None:
        self.params, self.state, self.feed = params[0], state[0], feed
        self.estimate = np.zeros(1, ESTIMATE)[0]
        self.estimate["load"] = self.params["static_load"]
        self.error, self.failed = np.zeros(4), np.zeros(4, np.uint8)
        self.guarded = np.zeros(4, np.uint8)
        params["rear_slip_margin"] = 0.005
        self.state["free_s"] = learned

    def run(
        self, slip, seconds=0.1, decel=5.0, speed=20.0, noise=0.0, lost=(), reckoned=0.0, accel=None
    ) -> float:
        """Return what the trailing axle is left after some time with a constant slip [%] of fl, fr, rl, rr.

        Wheel speeds carry no sign, as most sensors of them."""
        random = np.random.default_rng(0)
        p = self.params
        if accel is not None:
            self.estimate["accel_x"] = accel
        radius = [
            rolling_radius(*of)
            for of in zip(self.estimate["load"], p["unloaded_radius"], p["vertical_stiffness"], strict=True)
        ]
        for _ in range(round(seconds / DT)):
            omega = abs(speed) * (1 + np.array(slip) / 100) / (np.array(radius) * (1 + self.error))
            inputs = self.feed(wheel_speed=omega + noise * random.standard_normal(4))
            for i in lost:
                inputs[0]["new"][WHEEL_SPEED + i] = 0
            wheels = self.failed, self.guarded
            watch_trailing(p, self.state, inputs[0], self.estimate, *wheels, decel, speed, reckoned, DT)
        return float(self.state["trailing"])


@pytest.mark.parametrize("guarded", [(1, 1, 0, 0), (1, 0, 0, 0), (0, 0, 1, 1)])
def test_a_front_wheel_that_the_slip_guard_holds_is_no_measure(params, state, feed, guarded) -> None:
    watch = Watch(params, state, feed)
    watch.guarded[:] = guarded
    assert (watch.run(WORSE, seconds=0.3) == 1.0) == (guarded[:2] == (1, 1))


@pytest.fixture
def watch(params, state, feed) -> Watch:
    return Watch(params, state, feed)


LEAST_REAR = (LEAST_TRAILING, LEAST_TRAILING)
EQUAL, WORSE, BEYOND = (-3, -3, -3, -3), (-3, -3, -6, -6), (-3, -3, -4.5, -4.5)
SLOW = {"decel": 0.5, "speed": 6.0}
BY_4 = {"decel": 4.0, "accel": -4.0}
WATCHED = [
    # case, slip fl fr rl rr [%], other, what the rear is left after 0.3 s; later a slip as before is denied
    ("equal slip", EQUAL, {}, (1.0, 1.0)),
    ("rear 0.4 % beyond: within the margin", (-3, -3, -3.4, -3.4), {}, (1.0, 1.0)),
    ("rear 0.6 % beyond: within margin and noise", (-3, -3, -3.6, -3.6), {}, (1.0, 1.0)),
    ("rear 1.5 % beyond", BEYOND, {}, LEAST_REAR),
    # 0.82 % over margin and noise, 0.05 s late: 1 - 6 * 0.82 * (0.2 - 0.05) = 0.3
    ("rear 1.5 % beyond for 0.15 s", BEYOND, {"seconds": 0.15}, (0.4, 0.65)),
    ("one side is enough: the bend's inner wheels", (-3, -2, -4.5, -2), {"seconds": 0.15}, (0.4, 0.65)),
    ("front beyond the rear", (-5, -5, -3, -3), {}, (1.0, 1.0)),
    ("rear locked", (-3, -3, -100, -100), {"seconds": 0.05}, LEAST_REAR),
    ("the front reads 3 % fast, it is late: the rear hardly slips", (2, 2, -1, -1), {}, (1.0, 1.0)),
    ("the same, a speed by which the rear slips", (0, 0, -1, -1), {"reckoned": 20.4}, (0.55, 0.65)),
    ("a late front beside a rear that slips as its force needs", (3, 3, -1.6, -1.6), BY_4, (1.0, 1.0)),
    ("rear 1 % beyond that and the front", (-2, -2, -3.7, -3.7), BY_4, LEAST_REAR),
    ("an accelerometer that reads more than is asked for", (-3, -3, -6, -6), {"accel": -30.0}, LEAST_REAR),
    ("one that reads no braking", (-3, -3, -4.5, -4.5), {"accel": 4.0}, LEAST_REAR),
    ("backwards, a late rear", (-1.6, -1.6, 1.9, 1.9), BY_4 | {"accel": 4.0, "speed": -8.0}, (1.0, 1.0)),
    ("1.4 %, no braking measured: 1.2 % is of no force", (0, 0, -1.4, -1.4), {}, LEAST_REAR),
    ("0.5 m/s^2 asked for, more measured", (0, 0, -1.55, -1.55), {"decel": 0.5, "accel": -5.0}, LEAST_REAR),
    # 0.15 % over margin and noise at 6 m/s: 6 * 0.15 * (0.3 - 0.05)
    ("a little beyond the ground under a late front", (1.9, 1.9, -1.25, -1.25), SLOW, (0.7, 0.95)),
    ("backwards", (-1.25, -1.25, 1.9, 1.9), SLOW | {"speed": -6.0}, (0.7, 0.95)),
    ("a reckoning that is too slow hides nothing", BEYOND, {"reckoned": 15.0}, LEAST_REAR),
    ("both locked", (-100, -100, -100, -100), {}, (1.0, 1.0)),
    ("the front drives", (0.3, 0.3, 0.1, 0.1), {}, (1.0, 1.0)),
    ("noise of the wheel speeds at 20 m/s", (-3, -3, -3.4, -3.4), {"noise": 0.1}, (0.99, 1.0)),
    ("noise at 6 m/s", (-3, -3, -3.4, -3.4), {"noise": 0.1, "speed": 6.0}, (0.97, 1.0)),
    ("too slow for slip", WORSE, {"speed": 4.0}, (1.0, 1.0)),
    ("speed unknown", WORSE, {"speed": math.nan}, (1.0, 1.0)),
    ("a rear wheel's speed lost: the other side watches", WORSE, {"lost": (2,)}, LEAST_REAR),
    ("both lost: nobody watches", WORSE, {"lost": (2, 3)}, (1.0, 1.0)),
    ("both front wheels' lost", WORSE, {"lost": (0, 1)}, (1.0, 1.0)),
    ("a front wheel's sensor keeps its value: no slip of a braked wheel", (30, -3, -3, -3), {}, (1.0, 1.0)),
    ("nobody brakes", WORSE, {"decel": 0.0}, (1.0, 1.0)),
    ("request lost", WORSE, {"decel": math.nan}, (1.0, 1.0)),
    ("backwards, equal slip", EQUAL, {"speed": -8.0}, (1.0, 1.0)),
    ("backwards, front beyond the rear", (-5, -5, -3, -3), {"speed": -8.0}, LEAST_REAR),
    ("backwards, front beyond a rear that rolls", (-3, -3, 0, 0), {"speed": -8.0}, LEAST_REAR),
    ("backwards, 0.8 %: within margin and noise", (-3.8, -3.8, -3, -3), {"speed": -8.0}, (1.0, 1.0)),
    ("backwards, one front wheel locked", (-100, -3, -3, -3), {"speed": -8.0, "seconds": 0.05}, (0.3, 0.3)),
    ("backwards, rear beyond the front", WORSE, {"speed": -8.0}, (1.0, 1.0)),
    ("backwards, too slow for slip", (-5, -5, -3, -3), {"speed": -4.0}, (1.0, 1.0)),
]


@pytest.mark.parametrize(("case", "slip", "other", "rear"), WATCHED, ids=[row[0] for row in WATCHED])
def test_a_trailing_axle_that_slips_more_than_the_leading_one_is_taken_back(
    watch, case, slip, other, rear
) -> None:
    left = watch.run(slip, **{"seconds": 0.3} | other)
    assert rear[0] - 1e-9 <= left <= rear[1], case


def test_both_sides_slip_by_the_same_measures(watch) -> None:
    """What is kept of a side is its own: the right one alone is taken back as the left one alone."""
    left = watch.run((-3, -3, -4.5, -3), seconds=0.15)
    watch.run(EQUAL, seconds=1.0, decel=0.0)
    assert watch.run((-3, -3, -3, -4.5), seconds=0.15) == pytest.approx(left)


DENIED = [
    # case, slip fl fr rl rr [%] before, since the rear is relieved, left after a second more
    ("as before: the rear reads 1.5 % less", BEYOND, BEYOND, (0.8, 1.0)),
    ("it turns faster, but not enough", BEYOND, (-3, -3, -3.9, -3.9), LEAST_REAR),
    ("it locks", BEYOND, (-3, -3, -40, -40), LEAST_REAR),
    ("as before, deeper than any tyre rolls", (-3, -3, -18, -18), (-3, -3, -18, -18), LEAST_REAR),
    ("one side as before, the other locks", BEYOND, (-3, -3, -4.5, -40), LEAST_REAR),
]


@pytest.mark.parametrize(("case", "before", "since", "rear"), DENIED, ids=[row[0] for row in DENIED])
def test_a_slip_that_no_relief_changes_is_denied(watch, case, before, since, rear) -> None:
    watch.run(before, seconds=0.15)
    assert rear[0] - 1e-9 <= watch.run(since, seconds=1.0) <= rear[1], case


@pytest.mark.parametrize(
    ("left", "taken"),
    [(-4.5, False), (-5.5, False), (-6.5, True)],
    ids=["as the right one", "1 %", "2 % more"],
)
def test_a_wheel_that_reads_as_the_one_that_was_denied_is_not_held(watch, left, taken) -> None:
    """Both rear wheel speeds are in one frame; the left one differs once the right one was denied."""
    watch.run((-4.5, -3, -4.5, -4.5), seconds=1.0)
    assert watch.run((-3, -3, left, -4.5), seconds=0.1) > 0.95 or taken
    assert (watch.run((-3, -3, left, -4.5), seconds=0.1) < 0.7) == taken


@pytest.mark.parametrize("locks", [14.0, 40.0])
def test_a_denied_slip_that_grows_as_the_car_slows_stays_denied(watch, locks) -> None:
    """A speed too low by a constant is a share that grows slowly; that of a wheel that locks does not."""
    watch.run(BEYOND, seconds=1.5)
    left = [watch.run((-3, -3, -4.5 - more, -4.5 - more)) for more in np.arange(0.1, 4.5, 0.1)]
    assert min(left) > 0.9
    assert watch.run((-3, -3, -locks, -locks), seconds=0.25) == LEAST_TRAILING


def test_a_slip_is_denied_a_quarter_of_a_second_after_relief(watch) -> None:
    """The axle has lost 0.3 of its share 0.12 s after the slip began; denied, it regains 2 a second."""
    left = [watch.run(BEYOND, seconds=DT) for _ in range(56)]
    relieved = next(k for k, share in enumerate(left) if share < 0.7)
    returns = next(k for k in range(relieved, 56) if left[k] > left[k - 1])
    assert (returns - relieved) * DT == pytest.approx(0.26, abs=1.1 * DT)
    assert left[-1] - left[returns] == pytest.approx(2.0 * (55 - returns) * DT)


def test_a_denied_slip_is_taken_for_the_radius_within_a_tenth_of_a_second(watch) -> None:
    watch.state["trailing"], watch.state["held_s"] = 0.5, 1.0
    watch.run(BEYOND, seconds=DT)
    before = watch.state["offset"].copy()
    watch.run(BEYOND, seconds=DT)
    noise = watch.params["sigma_wheel_speed"] * watch.params["wheel_radius"][0] / 20.0
    excess = watch.state["beyond"] - 0.005 - noise
    assert watch.state["offset"] - before == pytest.approx(excess * DT / 0.1 * (excess > 0.0))


def test_a_wheel_that_slips_as_little_as_its_force_needs_is_not_judged(watch) -> None:
    """By 1 %: its share returns slowly, as one that did not slip."""
    watch.state["trailing"] = 0.5
    assert watch.run((0, 0, -1, -1), seconds=0.4) == pytest.approx(0.5 + 0.3 * 0.4)


def test_a_wheel_speed_that_was_lost_has_slipped_nothing(watch) -> None:
    watch.run(EQUAL, lost=(2, 3))
    assert watch.run(EQUAL) == 1.0


def test_before_radii_are_learned_more_is_doubted(params, state, feed) -> None:
    """0.8 % beside margin and noise of 0.68 %."""
    assert Watch(params, state, feed, learned=0.0).run((-3, -3, -4.4, -4.4), seconds=0.3) == 1.0
    assert Watch(params, state, feed, learned=0.0).run((-3, -3, -5, -5), seconds=0.3) < 0.6


LONGER = {"seconds": 1.0}
BESIDE_FAILED = [
    # failed, slip fl fr rl rr [%], other, what the rear is left after 0.3 s
    ("a rear wheel alone on its side may slip 4 %", (0,), (0, -3, -4, -3), {}, 1.0),
    ("not 6 %", (0,), (0, -3, -6, -3), {}, LEAST_TRAILING),
    ("nor for longer: there is nothing to compare it with", (0,), (0, -3, -8, -3), LONGER, LEAST_TRAILING),
    ("the other side is watched as ever", (0,), (0, -3, -3, -4.5), {}, LEAST_TRAILING),
    ("both rear wheels alone", (0, 1), (0, 0, -4, -4), {}, 1.0),
    ("a rear brake failed: nothing changes", (2,), (-3, -3, 0, -4.5), {}, LEAST_TRAILING),
    ("backwards, beside a failed rear brake", (2,), (-4, -3, 0, -3), {"speed": -8.0}, 1.0),
    ("backwards, a front brake failed", (0,), (-4.5, -3, -3, -3), {"speed": -8.0}, LEAST_TRAILING),
]


@pytest.mark.parametrize(
    ("case", "failed", "slip", "other", "rear"), BESIDE_FAILED, ids=[c[0] for c in BESIDE_FAILED]
)
def test_beside_a_failed_front_brake_a_rear_wheel_may_slip_more(
    watch, case, failed, slip, other, rear
) -> None:
    watch.failed[list(failed)] = 1
    assert watch.run(slip, **{"seconds": 0.3} | other) == pytest.approx(rear), case


def test_the_radii_that_load_transfer_changes_are_no_slip(watch) -> None:
    """At 8 m/s^2 the front's radius is 0.3 % smaller, the rear's larger: 0.6 % of slip that is not there."""
    watch.estimate["load"] += np.array([1, 1, -1, -1]) * 0.5 * 2105 * 8.0 * 0.65 / 2.665
    assert watch.run((-5, -5, -5.4, -5.4), seconds=2.0) == 1.0


@pytest.mark.parametrize("error", [0.006, -0.006])
def test_radii_on_either_side_are_learned(params, state, feed, error) -> None:
    watch = Watch(params, state, feed, learned=0.0)
    watch.error[2:] = error
    watch.run((0, 0, 0, 0), seconds=3.0, decel=0.0)
    assert state["offset"][0] == pytest.approx([error, error], abs=2e-4)


def test_what_the_radii_differ_is_learned_while_rolling_freely(params, state, feed) -> None:
    watch = Watch(params, state, feed, learned=0.0)
    watch.error[2:] = 0.006
    assert watch.run((-3, -3, -3.4, -3.4)) == 1.0, "not learned yet: doubted"
    watch.run((0, 0, 0, 0), seconds=3.0, decel=0.0, noise=0.1)
    assert state["offset"][0] == pytest.approx([0.006, 0.006], abs=1e-3)
    assert watch.run((-3, -3, -3.4, -3.4)) == 1.0
    assert watch.run(BEYOND, seconds=0.5) < 0.6


@pytest.mark.parametrize("moving", [{"accel_x": 0.6}, {"accel_x": -0.6}, {"yaw_rate": 0.04}])
def test_nothing_is_learned_while_the_car_does_not_roll_freely(params, state, feed, moving) -> None:
    watch = Watch(params, state, feed, learned=0.0)
    for name, value in moving.items():
        watch.estimate[name] = value
    watch.run((0, 0, -1, -1), seconds=3.0, decel=0.0)
    assert state["offset"].tolist() == [[0.0, 0.0]]


def test_the_rear_comes_back_slowly_and_at_once_with_the_next_braking(watch) -> None:
    watch.state["trailing"] = 0.4
    assert watch.run(EQUAL, seconds=1.0) == pytest.approx(0.7)
    assert watch.run(EQUAL, seconds=DT, decel=0.0) == 1.0


SLIPPING = [
    # case, slip fl fr rl rr [%], speed, part of the rest that the leading axle takes
    ("neither slips", EQUAL, 20.0, 1.0),
    ("one by 4 %", (-4, -3, -3, -3), 20.0, 1.0),
    ("one by 6 %", (-3, -6, -3, -3), 20.0, 0.0),
    ("backwards, a rear one by 4 %", (-3, -3, -4, -3), -8.0, 1.0),
    ("backwards, a rear one by 6 %", (-3, -3, -3, -6), -8.0, 0.0),
]


@pytest.mark.parametrize(("case", "slip", "speed", "part"), SLIPPING, ids=[row[0] for row in SLIPPING])
@pytest.mark.parametrize("decel", [0.5, 3.0])
def test_a_leading_axle_that_slips_takes_nothing_more_until_the_braking_ends(
    watch, case, slip, speed, part, decel
) -> None:
    p, state, backwards = watch.params, watch.state, speed < 0.0

    def taken(asked: float) -> float:
        state["trailing"] = 0.6
        distribute(p, state, p["mass"], asked, backwards, DT)
        full = p["mass"] * asked
        return 1.0 - (full - np.sum(state["torque"] / p["wheel_radius"])) / (0.4 * full * trails)

    lead = front_share(p, -decel if backwards else decel)
    trails = lead if backwards else 1.0 - lead
    watch.run(slip, seconds=0.5, speed=speed, decel=decel)
    for _ in range(150):
        taken(decel)
    assert taken(decel) == pytest.approx(part, abs=0.01), case
    watch.run(EQUAL, seconds=0.5, speed=speed, decel=decel)
    assert taken(decel) == pytest.approx(part, abs=0.01), "it rolls again in the same braking"
    distribute(p, state, p["mass"], 0.0, backwards, DT)
    assert taken(decel) == pytest.approx(1.0), "the next braking"


def test_a_leading_wheel_that_slips_while_nobody_brakes_spends_nothing(params, state) -> None:
    """It pulls, or turns a bend: the next braking begins as any."""
    state["rolled"] = 0.9
    distribute(params[0], state[0], params[0]["mass"], 0.0, False, DT)
    assert (state["grip"][0], state["spent"][0]) == (0.6, 0)


def relieved(watch, *stretches, speed: float = 20.0) -> float:
    """Return the trailing axle's share after `stretches`, each its seconds and the slip [%] of the wheels."""
    for seconds, slip in stretches:
        for _ in range(round(seconds / DT)):
            watch.run(slip, seconds=DT, speed=speed)
            distribute(watch.params, watch.state, watch.params["mass"], 5.0, speed < 0.0, DT)
    return float(watch.state["trailing"])


RELIEVED = [
    # case, slip fl fr rl rr [%] as the leading axle lets go, 0.15 s after it, for how long, trailing share
    ("the front alone slips less", (-6, -6, -6.2, -6.2), (-4, -4, -6.2, -6.2), 0.2, (1.0, 1.0)),
    ("later it is a measure again", (-6, -6, -6.2, -6.2), (-4, -4, -6.2, -6.2), 0.55, (LEAST_TRAILING, 0.5)),
    ("the rear slips more than the front did", (-6, -6, -6.2, -6.2), (-4, -4, -8, -8), 0.2, (0.3, 0.5)),
    ("one front wheel slipped", (-6, -4, -4, -4.6), (-4, -4, -4, -4.6), 0.2, (1.0, 1.0)),
    ("the front rolls", (-4, -4, -4.2, -4.2), (-2, -2, -4.2, -4.2), 0.2, (LEAST_TRAILING, 0.5)),
]


@pytest.mark.parametrize(
    ("case", "before", "since", "seconds", "share"), RELIEVED, ids=[r[0] for r in RELIEVED]
)
def test_a_leading_axle_that_was_just_relieved_is_no_measure(
    watch, case, before, since, seconds, share
) -> None:
    assert share[0] <= relieved(watch, (0.3, before), (seconds, since)) <= share[1], case


def test_in_reverse_the_rear_axle_that_was_just_relieved_is_none(watch) -> None:
    stretches = (0.3, (-6.2, -6.2, -6, -6)), (0.2, (-6.2, -6.2, -4, -4))
    assert relieved(watch, *stretches, speed=-8.0) == 1.0


def test_what_the_leading_axle_slipped_once_fades(watch) -> None:
    stretches = (0.1, (-15, -15, -6, -6)), (1.0, (-6, -6, -6, -6)), (0.2, (-4, -4, -8, -8))
    assert relieved(watch, *stretches) < 0.5


@pytest.mark.parametrize("slipped_s", [0.03, 0.06])
def test_a_leading_axle_that_slips_gives_back_as_long_as_it_does(params, state, slipped_s) -> None:
    """A wheel is beyond 5 % for a moment: the axle keeps what it can carry, and takes no more."""
    p, leading = params[0], slice(0, 2)
    row = state[0]
    row["trailing"] = 0.3

    def force(rolled: float) -> float:
        row["rolled"] = rolled, 1.0
        distribute(p, row, p["mass"], 3.0, False, DT)
        return float(np.sum(row["torque"][leading] / p["wheel_radius"][leading]))

    before = force(1.0)
    for _ in range(round(slipped_s / DT)):
        last = force(0.94)
    kept = [force(0.97) for _ in range(100)]
    assert kept == pytest.approx([kept[0]] * 100)
    assert kept[0] / before == pytest.approx((1.0 - DT / RELEASE_S) ** round(slipped_s / DT), rel=1e-3)
    assert kept[0] < last < before


def torques_of(params, pressure, mu) -> np.ndarray:
    p = params[0]
    acts = np.maximum(np.array(pressure) - p["push_out_pressure"], 0.0)
    return 2 * p["piston_area"] * p["effective_radius"] * acts * mu


NONE = np.zeros(4, np.uint8)


def capped(
    params, state, z, wanted, mu, sigma, motor=(0.0, 0.0), backwards=False, failed=NONE, mu_failed=None
) -> tuple[np.ndarray, np.ndarray]:
    """Return pressures before and after the cap; `wanted`: friction that front and rear count on."""
    p, decel = params[0], z * G
    distribute(p, state[0], p["mass"], decel, backwards, DT)
    lining = state[0]["torque"] * (1 - np.repeat(motor, 2))
    lever = 2 * p["piston_area"] * p["effective_radius"]
    before = lining / (lever * np.repeat(wanted, 2)) + p["push_out_pressure"]
    estimate, after = np.zeros(1, ESTIMATE), before.copy()
    estimate["mu"], estimate["sigma"] = np.repeat(mu, 2), np.repeat(sigma, 2)
    if mu_failed is not None:
        estimate["mu"][0, failed != 0] = mu_failed
    cap_trailing(p, state[0], decel, lining, estimate[0], after, failed, backwards)
    return before, after


CAPS = [
    # case, z, compensated by (front, rear), mu, sigma, motors' share, rear torque left at mu
    ("nominal friction, nothing known", 0.5, (0.45, 0.45), (0.45, 0.45), (0.07, 0.07), (0, 0), 1.0),
    ("rear 20 % rough: its pressure falls", 0.5, (0.45, 0.54), (0.45, 0.54), (0.02, 0.02), (0, 0), 1.0),
    ("both 20 % smooth: the share is kept", 0.5, (0.36, 0.36), (0.36, 0.36), (0.05, 0.05), (0, 0), 1.0),
    # 0.36 / 0.45: the rear keeps the pressure of nominal friction, 0.8 of the torque asked for
    ("rear 20 % smooth, not sure", 0.5, (0.45, 0.36), (0.45, 0.36), (0.045, 0.045), (0, 0), 0.8),
    # (0.45 - 0.02) / 0.45 * 0.36 / (0.36 + 0.02) = 0.905
    (
        "rear 20 % smooth, sure to 1 sigma = 0.01",
        0.5,
        (0.45, 0.36),
        (0.45, 0.36),
        (0.01, 0.01),
        (0, 0),
        0.905,
    ),
    ("rear 20 % smooth, certain", 0.5, (0.45, 0.36), (0.45, 0.36), (0.0, 0.0), (0, 0), 1.0),
    # 0.45 / 0.54: the front falls to 5/6 of its pressure and takes the rear with it
    ("front 20 % rough, not sure", 0.5, (0.54, 0.45), (0.54, 0.45), (0.05, 0.05), (0, 0), 0.8333),
    ("below z 0.15 nothing is ruled", 0.14, (0.45, 0.36), (0.45, 0.36), (0.045, 0.045), (0, 0), 1.0),
    # of T = 1: front lining 0.5 * 0.43/0.45 + motor 0.5 = 0.9778; rear (0.9778 - 0.5) * 0.36/0.38 / 0.5
    ("the same half on motors", 0.5, (0.45, 0.36), (0.45, 0.36), (0.01, 0.01), (0.5, 0.5), 0.905),
    ("front on motors alone", 0.5, (0.45, 0.36), (0.45, 0.36), (0.01, 0.01), (1.0, 0.0), 0.947),
    # 0.36 / (0.36 + 0.18) = 0.667, but no less than the pressure of nominal friction
    ("front on motors alone, rear not sure", 0.5, (0.45, 0.36), (0.45, 0.36), (0.01, 0.09), (1.0, 0.0), 0.8),
]


@pytest.mark.parametrize(
    ("case", "z", "wanted", "mu", "sigma", "motor", "left"), CAPS, ids=[row[0] for row in CAPS]
)
def test_compensation_raises_the_rear_only_as_far_as_it_is_sure(
    params, state, case, z, wanted, mu, sigma, motor, left
) -> None:
    before, after = capped(params, state, z, wanted, mu, sigma, motor)
    was, now = (torques_of(params, pressure, np.repeat(mu, 2)) for pressure in (before, after))
    assert after[:2] == pytest.approx(before[:2]), "the front is never touched"
    assert now[2:] / was[2:] == pytest.approx(left, abs=5e-4), case


@pytest.mark.parametrize(
    ("case", "z", "wanted", "mu", "sigma", "motor", "left"), CAPS, ids=[row[0] for row in CAPS]
)
def test_backwards_compensation_raises_the_front_only_as_far_as_it_is_sure(
    params, state, case, z, wanted, mu, sigma, motor, left
) -> None:
    """The same cases with the axles' places exchanged: which share of the torque an axle has cancels."""
    ends = [of[::-1] for of in (wanted, mu, sigma, motor)]
    before, after = capped(params, state, z, *ends, backwards=True)
    was, now = (torques_of(params, pressure, np.repeat(ends[1], 2)) for pressure in (before, after))
    assert after[2:] == pytest.approx(before[2:]), "the rear leads and is never touched"
    assert now[:2] / was[:2] == pytest.approx(left, abs=5e-4), case


@pytest.mark.parametrize("z", [0.2, 0.5])
def test_backwards_within_the_claimed_interval_the_front_stays_behind(params, state, z: float) -> None:
    """As forwards, with the loads that a braking backwards gives: z is taken off the front."""
    p = params[0]
    _, after = capped(params, state, z, (0.36, 0.45), (0.36, 0.45), (0.012, 0.01), backwards=True)
    torque = torques_of(params, after, np.array([0.384, 0.384, 0.43, 0.43]))
    front, rear = torque[:2].sum() / p["wheel_radius"][0], torque[2:].sum() / p["wheel_radius"][2]
    on_front = (p["rear_axle"] - z * p["cog_height"]) / p["wheelbase"]
    assert front / on_front == pytest.approx(rear / (1 - on_front))


def test_within_the_claimed_interval_the_rear_stays_behind_once_it_is_raised(params, state) -> None:
    """Utilisations by axle loads, rear at mu + 2 sigma, front at mu - 2 sigma: equal where the cap binds."""
    p = params[0]
    for z in (0.2, 0.5, 0.8):
        _, after = capped(params, state, z, (0.45, 0.36), (0.45, 0.36), (0.01, 0.012))
        torque = torques_of(params, after, np.array([0.43, 0.43, 0.384, 0.384]))
        front, rear = torque[:2].sum() / p["wheel_radius"][0], torque[2:].sum() / p["wheel_radius"][2]
        on_front = (p["rear_axle"] + z * p["cog_height"]) / p["wheelbase"]
        assert rear / (1 - on_front) == pytest.approx(front / on_front)


@pytest.mark.parametrize("name", ["suv", "sedan", "lcv", "mustang"])
def test_shipped_configurations_have_the_ideal_distribution(name: str) -> None:
    assert new_params(load_config(CONFIGS / f"{name}.toml"))[0]["distribution"] == IDEAL


def test_where_the_trailing_linings_do_nothing_there_is_nothing_to_cap(params, state) -> None:
    before, after = capped(params, state, 0.5, (0.45, 0.36), (0.45, 0.36), (0.05, 0.05), motor=(0.0, 1.0))
    assert before[2:] == pytest.approx([params["push_out_pressure"][0, 2]] * 2)
    assert after.tolist() == before.tolist()


def test_linings_whose_nominal_frictions_differ_keep_the_pressures_of_these(params, state) -> None:
    params["mu_nominal"][0, 2:] = 0.36
    before, after = capped(params, state, 0.5, (0.45, 0.36), (0.45, 0.36), (0.09, 0.09))
    assert after == pytest.approx(before)


def test_a_brake_that_gives_nothing_is_no_part_of_its_axles_rule(params, state) -> None:
    """Rear 20 % smooth and not sure of it: each wheel that brakes is held as both would be."""
    known = (0.5, (0.45, 0.36), (0.45, 0.36), (0.045, 0.045))
    both = capped(params, state, *known)[1]
    for dead in (2, 3):
        failed = np.arange(4) == dead
        before, after = capped(params, state, *known, failed=failed.astype(np.uint8))
        alive = 5 - dead
        assert after[alive] < before[alive]
        assert after[:2].tolist() == both[:2].tolist()


@pytest.mark.parametrize("dead", range(4))
def test_nothing_that_is_thought_of_a_failed_brake_counts(params, state, dead) -> None:
    """Rear 20 % smooth, sure to a sigma of 0.01: friction of the failed brake has fallen to 0.05."""
    known = (0.5, (0.45, 0.36), (0.45, 0.36), (0.01, 0.01))
    both = capped(params, state, *known)[1]
    failed = np.arange(4) == dead
    after = capped(params, state, *known, failed=failed.astype(np.uint8), mu_failed=0.05)[1]
    assert after[~failed] == pytest.approx(both[~failed])


@pytest.mark.parametrize("backwards", [False, True])
def test_without_a_leading_brake_there_is_nothing_to_be_behind(params, state, backwards) -> None:
    failed = np.array([1, 1, 0, 0] if not backwards else [0, 0, 1, 1], np.uint8)
    known = (0.5, (0.45, 0.45), (0.36, 0.36), (0.045, 0.045))
    with np.errstate(divide="raise", invalid="raise"):
        before, after = capped(params, state, *known, failed=failed, backwards=backwards)
    assert after.tolist() == before.tolist()
