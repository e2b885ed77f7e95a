"""A brake that gives nothing: which evidence makes it one, and where its torque goes."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ecu.algorithm.control.distribution import DISTRIBUTION_STATE, distribute
from ecu.algorithm.control.failed_brakes import (
    FAILED_BRAKES_STATE,
    GRIP,
    GRIP_RATE,
    YAW_LIMIT,
    replace_failed,
    watch_brakes,
)
from ecu.algorithm.control.pressure_law import PRESSURE_LAW_STATE
from ecu.algorithm.estimate import ESTIMATE
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

G, DT = 9.81, 0.01
FL, FR, RL, RR = range(4)
MU = 0.4


class Watched:
    """A car at 20 m/s whose linings have the friction that the law counts on, or `rough` times that."""

    def __init__(self, params, feed, rough: float = 1.0) -> None:
        self.params, self.feed, self.rough = params[0], feed, rough
        self.state = np.zeros(1, FAILED_BRAKES_STATE)[0]
        self.state["scale"] = 1.0
        self.law = np.zeros(1, PRESSURE_LAW_STATE)[0]
        self.law["base"] = MU

    def force(self, pressure: Any) -> float:
        """Return the braking force [N] of pressures [bar] by (A.19), written out."""
        p, total = self.params, 0.0
        for i in range(4):
            acts = max(pressure[i] * 1e5 - p["push_out_pressure"][i], 0.0)
            torque = 2 * acts * p["piston_area"][i] * self.rough * MU * p["effective_radius"][i]
            total += torque / p["wheel_radius"][i]
        return total

    def run(self, seconds, demand, true, read, sent=True, **other) -> list[int]:
        """Brake: pressures demanded, true and read [bar]; return which brakes are held for failed."""
        p = self.params
        estimate = np.zeros(1, ESTIMATE)[0]
        estimate["measured"] = other.pop("measured", 1)
        motor = np.array(other.get("motor_torque", np.zeros(4)))
        braked = self.force(true) + (motor / p["wheel_radius"]).sum()
        estimate["tyre_force"] = -(braked + p["rolling_resistance"] * p["mass"] * G)
        inputs = self.feed(calliper_pressure=np.array(read, float), **other)[0]
        for _ in range(round(seconds / DT)):
            watch_brakes(
                p, self.state, inputs, estimate, self.law, np.array(demand, float), np.zeros(4), sent, DT
            )
        return np.flatnonzero(self.state["failed"]).tolist()


ALL = (40.0, 40.0, 45.0, 45.0)


def without(*dead: int, left: float = 0.0) -> tuple[float, ...]:
    return tuple(left if i in dead else ALL[i] for i in range(4))


VERDICTS = [
    # case, friction over the law's, true, read, other, failed
    ("all follow", 1.0, ALL, ALL, {}, []),
    ("front left dead", 1.0, without(FL), without(FL), {}, [FL]),
    ("rear right dead", 1.0, without(RR), without(RR), {}, [RR]),
    ("a fifth of the pressure is left", 1.0, without(FL, left=8.0), without(FL, left=8.0), {}, [FL]),
    ("front circuit", 1.0, without(FL, FR), without(FL, FR), {}, [FL, FR]),
    ("diagonal circuit", 1.0, without(FL, RR), without(FL, RR), {}, [FL, RR]),
    ("nothing brakes", 1.0, without(FL, FR, RL, RR), without(FL, FR, RL, RR), {}, [FL, FR, RL, RR]),
    ("dead, linings 15 % rougher than known", 1.15, without(FL), without(FL), {}, [FL]),
    ("rear dead, linings 15 % rougher", 1.15, without(RL), without(RL), {}, [RL]),
    ("the sensor reads nothing, the brake is there", 1.0, ALL, without(FL), {}, []),
    ("the same, linings 10 % smoother", 0.9, ALL, without(FL), {}, []),
    ("a pressure 40 % short", 1.0, without(FL, left=24.0), without(FL, left=24.0), {}, []),
    ("motors brake beside", 1.0, without(FL), without(FL), {"motor_torque": np.full(4, 300.0)}, [FL]),
    ("demands not valid: a shadow", 1.0, without(FL), without(FL), {"sent": False}, []),
    ("an ABS works", 1.0, without(FL), without(FL), {"abs_active": 1.0}, []),
    ("no accelerometer", 1.0, without(FL), without(FL), {"measured": 0}, []),
    ("hardly any pressure asked for", 1.0, (0, 0, 0, 0), (0, 0, 0, 0), {"demand": (7, 7, 7, 7)}, []),
]


@pytest.mark.parametrize(
    ("case", "rough", "true", "read", "other", "failed"), VERDICTS, ids=[row[0] for row in VERDICTS]
)
def test_a_brake_has_failed_where_pressure_and_force_are_missing(
    params, feed, case, rough, true, read, other, failed
) -> None:
    car = Watched(params, feed, rough)
    asked = other.get("demand", ALL)
    other = {name: value for name, value in other.items() if name != "demand"}
    motors = {name: other[name] for name in other if name == "motor_torque"}
    assert car.run(1.0, asked, asked, asked, **motors) == [], "sound before"
    assert car.run(0.2, asked, true, read, **other) == failed, case


def test_a_brake_that_comes_back_is_used_again(params, feed) -> None:
    car = Watched(params, feed)
    car.run(1.0, ALL, ALL, ALL)
    assert car.run(0.2, ALL, without(FL), without(FL)) == [FL]
    assert car.run(0.05, ALL, ALL, ALL) == []


def test_a_dead_brake_stays_one_into_the_next_braking_and_a_sensor_does_not(params, feed) -> None:
    rest = (0.0,) * 4
    car = Watched(params, feed)
    car.run(1.0, ALL, ALL, ALL)
    car.run(0.2, ALL, without(FL), without(FL))
    assert car.run(2.0, rest, rest, rest) == [FL]
    assert car.run(0.5, ALL, without(FL), without(FL)) == [FL]
    car.run(2.0, rest, rest, rest)
    assert car.run(0.3, ALL, ALL, without(FL)) == [], "early in another braking its force is there"


def test_friction_that_rises_later_in_a_braking_does_not_acquit(params, feed) -> None:
    car = Watched(params, feed)
    car.run(1.0, ALL, ALL, ALL)
    car.run(0.6, ALL, without(RL), without(RL))
    car.rough = 1.3
    assert car.run(1.0, ALL, without(RL), without(RL)) == [RL]


class Replaced:
    """Torque after a second with these brakes failed."""

    def __init__(
        self, params, failed, decel, backwards=False, allowed=0.0, seconds=1.0, trailing=1.0
    ) -> None:
        p = self.params = params[0]
        state, distribution = np.zeros(1, FAILED_BRAKES_STATE)[0], np.zeros(1, DISTRIBUTION_STATE)[0]
        distribution["trailing"] = trailing
        cycles = round(seconds / DT)
        for k in range(cycles + 1):
            distribute(p, distribution, p["mass"], decel, backwards, DT)
            self.before = distribution["torque"] / p["wheel_radius"]
            if k:
                state["failed"][list(failed)], state["any"] = 1, len(failed) > 0
            replace_failed(p, state, distribution, np.full(4, allowed), decel, backwards, DT)
        self.state, self.distribution = state, distribution
        self.force = distribution["torque"] / p["wheel_radius"]
        z = decel / G * (-1.0 if backwards else 1.0)
        front = (p["rear_axle"] + z * p["cog_height"]) / p["wheelbase"]
        self.load = p["mass"] * G * 0.5 * np.array([front, front, 1 - front, 1 - front])
        self.alive = [i for i in range(4) if i not in failed]


FAILURES = [(FL,), (FR,), (RL,), (RR,), (FL, RR), (RL, RR)]


@pytest.mark.parametrize("failed", FAILURES)
@pytest.mark.parametrize("decel", [1.0, 2.0, 3.0])
def test_the_others_give_all_of_it_each_by_its_load(params, failed, decel) -> None:
    car = Replaced(params, failed, decel)
    assert car.force[car.alive].sum() == pytest.approx(car.before.sum())
    grip = car.force[car.alive] / car.load[car.alive]
    assert grip == pytest.approx(grip[0])
    assert car.force[list(failed)] == pytest.approx(car.before[list(failed)]), "asked as before"


def test_nothing_is_moved_while_all_brakes_work(params) -> None:
    car = Replaced(params, (), 5.0)
    assert car.force == pytest.approx(car.before)


@pytest.fixture(scope="module")
def suv():
    return new_params(load_config(resource("config/suv.toml")))


@given(
    st.sets(st.integers(0, 3), max_size=3),
    st.floats(0.1, 12.0),
    st.booleans(),
    st.floats(0.0, 2000.0),
    st.floats(0.3, 1.0),
)
def test_limits_hold_for_any_failure(
    suv, failed: set[int], decel: float, backwards: bool, allowed: float, trailing: float
) -> None:
    assume(failed)
    suv[0]["blending"] = [0.5, 0.5, 0.0, 0.0]
    car = Replaced(suv, sorted(failed), decel, backwards, allowed, seconds=0.3, trailing=trailing)
    p = suv[0]
    assert np.isfinite(car.force).all()
    assert (car.force >= 0.0).all()
    assert (car.force.sum() <= car.before.sum() * (1 + 1e-9) + car.before[sorted(failed)].sum()).all()
    motors = np.minimum(allowed / p["wheel_radius"], car.before) * (p["blending"] > 0.0)
    acts = np.where([i in failed for i in range(4)], motors, car.force)
    moment = abs(acts[[FL, RL]].sum() - acts[[FR, RR]].sum()) * p["track"] / 2
    limit = YAW_LIMIT * p["mass"] * G * p["rear_axle"]
    raised = max(car.force[i] - car.before[i] for i in car.alive)
    if raised > 1e-6:
        heavy = (FL, RL) if acts[[FL, RL]].sum() > acts[[FR, RR]].sum() else (FR, RR)
        added = sum(max(car.force[i] - car.before[i], 0.0) for i in heavy if i not in failed)
        assert moment <= limit * (1 + 1e-9) or added <= 1e-6


def test_grip_that_no_road_may_have_is_asked_for_slowly(params) -> None:
    """Rear alone at 4 m/s^2: it would take the whole grip of a dry road."""
    for seconds in (0.1, 0.3):
        car = Replaced(params, (FL, FR), 4.0, seconds=seconds)
        grip = car.force[[RL, RR]] / car.load[[RL, RR]]
        assert grip == pytest.approx(min(GRIP + GRIP_RATE * seconds, 1.0), rel=0.05)


def test_motors_of_a_failed_brake_come_first(params) -> None:
    params[0]["blending"] = 1.0
    torque = 500.0
    car = Replaced(params, (FL,), 3.0, allowed=torque)
    own = torque / params[0]["wheel_radius"][FL]
    assert car.force[car.alive].sum() + own == pytest.approx(car.before.sum())


def test_a_braking_that_nobody_asks_for_is_not_moved(params) -> None:
    car = Replaced(params, (FL,), math.nan)
    assert np.isnan(car.force).all()


def test_the_axle_that_slips_is_relieved_here_too(params) -> None:
    free, held = Replaced(params, (FL,), 3.0), Replaced(params, (FL,), 3.0, trailing=0.5)
    assert held.force[RL] / held.load[RL] == pytest.approx(0.5 * held.force[FR] / held.load[FR])
    assert held.force[FR] > free.force[FR]


@pytest.mark.parametrize(
    ("failed", "again"), [((FL, FR), FL), ((FL, RR), RR), ((RL, RR), RL), ((FL, FR, RL), FL)]
)
def test_one_of_several_failed_brakes_that_is_sound_again_relieves_the_others_by_degrees(
    params, failed, again
) -> None:
    """Not before its own pressure has risen: they would give less for that time."""
    decel = 1.5
    car = Replaced(params, failed, decel)
    p, state, distribution = car.params, car.state, car.distribution
    state["failed"][again] = 0
    force = car.force.copy()
    for _ in range(10):
        last = force
        distribute(p, distribution, p["mass"], decel, False, DT)
        replace_failed(p, state, distribution, np.zeros(4), decel, False, DT)
        force = distribution["torque"] / p["wheel_radius"]
        brakes = [i for i in range(4) if i not in failed or i == again]
        assert force[brakes].sum() >= car.before.sum() * (1 - 1e-9)
        assert (force[car.alive] >= 0.7 * last[car.alive]).all()
    left = [i for i in failed if i != again]
    assert force == pytest.approx(Replaced(params, left, decel).force)


def test_with_no_brake_left_nothing_is_moved(params) -> None:
    car = Replaced(params, (FL, FR, RL, RR), 3.0)
    assert car.force == pytest.approx(car.before)
