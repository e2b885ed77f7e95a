"""Where the torque of a failed brake goes."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ecu.algorithm.control.distribution import DISTRIBUTION_STATE, distribute
from ecu.algorithm.control.replacement import (
    GRIP,
    GRIP_RATE,
    REPLACEMENT_STATE,
    YAW_LIMIT,
    replace_failed,
)
from ecu.algorithm.monitoring.failed_brakes import FAILED_BRAKES_STATE
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

G, DT = 9.81, 0.01
FL, FR, RL, RR = range(4)


class Replaced:
    """Torque after a second with these brakes failed."""

    def __init__(
        self, params, failed, decel, backwards=False, allowed=0.0, seconds=1.0, trailing=1.0
    ) -> None:
        p = self.params = params[0]
        state, distribution = np.zeros(1, REPLACEMENT_STATE)[0], np.zeros(1, DISTRIBUTION_STATE)[0]
        brakes = np.zeros(1, FAILED_BRAKES_STATE)[0]
        distribution["trailing"] = trailing
        cycles = round(seconds / DT)
        for k in range(cycles + 1):
            distribute(p, distribution, p["mass"], decel, backwards, DT)
            self.before = distribution["torque"] / p["wheel_radius"]
            if k:
                brakes["failed"][list(failed)], brakes["any"] = 1, len(failed) > 0
            replace_failed(p, state, brakes, distribution, np.full(4, allowed), decel, backwards, DT)
        self.state, self.brakes, self.distribution = state, brakes, distribution
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


@pytest.mark.parametrize(("failed", "decel"), [((FL, RL), 3.0), ((FL, RL), 5.0), ((FL,), 7.0)])
def test_what_would_turn_the_car_is_given_up_to_the_limit_and_no_less(params, failed, decel) -> None:
    car = Replaced(params, failed, decel)
    acts = np.where(np.isin(range(4), failed), 0.0, car.force)
    moment = (acts[[FR, RR]].sum() - acts[[FL, RL]].sum()) * car.params["track"] / 2
    assert moment == pytest.approx(YAW_LIMIT * car.params["mass"] * G * car.params["rear_axle"])
    assert (car.force[[FR, RR]] > car.before[[FR, RR]]).all()


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
    p, state, brakes, distribution = car.params, car.state, car.brakes, car.distribution
    brakes["failed"][again] = 0
    force = car.force.copy()
    for _ in range(10):
        last = force
        distribute(p, distribution, p["mass"], decel, False, DT)
        replace_failed(p, state, brakes, distribution, np.zeros(4), decel, False, DT)
        force = distribution["torque"] / p["wheel_radius"]
        braking = [i for i in range(4) if i not in failed or i == again]
        assert force[braking].sum() >= car.before.sum() * (1 - 1e-9)
        assert (force[car.alive] >= 0.7 * last[car.alive]).all()
    left = [i for i in failed if i != again]
    assert force == pytest.approx(Replaced(params, left, decel).force)


def test_with_no_brake_left_nothing_is_moved(params) -> None:
    car = Replaced(params, (FL, FR, RL, RR), 3.0)
    assert car.force == pytest.approx(car.before)
