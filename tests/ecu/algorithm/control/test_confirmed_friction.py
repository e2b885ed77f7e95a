"""A friction that the deceleration does not confirm does not take the brakes."""

import math

import numpy as np
import pytest

from ecu.algorithm.control.confirmed_friction import confirm_friction
from ecu.algorithm.control.pressure_law import PRESSURE_LAW_STATE, follow_friction, set_base
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.accel_blocks import BLOCK_S, ROLLED
from ecu.algorithm.monitoring.acceleration import ACCELERATION_STATE
from ecu.algorithm.monitoring.error_line import LINE_STATE
from ecu.algorithm.vehicle import tyre_slip
from ecu.contract.params import GRAVITY
from ecu.contract.records import LEARNED

DT, MU, DECEL = 0.01, 0.45, 4.0


class Car:
    """Brakes with 4 m/s^2; friction in use decides how hard, by linings whose true friction may change."""

    def __init__(self, params, lag: float = 0.1, slowness: float = 1.0) -> None:
        self.lag, self.slowness = lag, slowness
        self.p, self.law = params[0], np.zeros(1, PRESSURE_LAW_STATE)[0]
        self.law["base"] = self.law["used"] = MU
        self.law["mu_override"], self.law["start"] = math.nan, 1.0
        self.estimate = np.zeros(1, ESTIMATE)[0]
        self.estimate["sigma"], self.estimate["observed_s"], self.estimate["measured"] = 0.01, 2.0, 1
        self.blocks, self.line = np.zeros(1, ACCELERATION_STATE)[0], np.zeros(1, LINE_STATE)[0]
        self.force = self.most = 0.0

    @property
    def state(self):
        return self.law["confirmed"]

    def brake(
        self,
        seconds,
        believed=MU,
        true=MU,
        reads=0.0,
        offset=0.0,
        scale=0.0,
        decel=DECEL,
        calm=True,
        speed=20.0,
        slope=0.0,
    ):
        """Return the least force over demand.

        `reads`: error of the accelerometer, `offset`: c, `scale`: s, `slope`: what gravity adds
        to dv/dt [m/s^2].
        """
        least = math.inf
        self.line["now"]["offset"], self.line["now"]["scale"] = offset, scale
        self.estimate["mu"], self.estimate["speed"] = believed, speed
        resistance = self.p["drag_area"] * speed**2 / self.p["mass"] + self.p["rolling_resistance"] * GRAVITY
        for _ in range(round(seconds / DT)):
            given = decel * true / float(np.mean(self.law["used"]))
            self.force += (given - self.force) * DT / self.lag
            slows = self.force + resistance
            self.estimate["accel_x"] = -slows + reads
            rolled = (slope - slows) / (1.0 + tyre_slip(self.p, slope - slows))
            self.blocks["mean"][:3, ROLLED] = 20.0, 20.0 - BLOCK_S * rolled, 20.0 - 2.0 * BLOCK_S * rolled
            confirm_friction(
                self.p, self.state, self.estimate, self.law["used"], self.line, self.blocks, decel, calm,
                self.slowness, DT,
            )  # fmt: skip
            follow_friction(self.p, self.law, self.estimate, DT)
            least, self.most = min(least, self.force / decel), max(self.most, self.force / decel)
        return least


@pytest.fixture
def car(params) -> Car:
    car = Car(params)
    car.brake(3.0)
    assert list(car.state["friction"]) == pytest.approx([MU] * 4)
    assert car.state["back"] == 0.0
    return car


CASES = [
    # case, what differs, friction in use after 6 s, over the one before
    ("nothing", {}, 1.0, 1.0),
    ("the linings rub harder, and the estimate says so", {"believed": 1.3 * MU, "true": 1.3 * MU}, 1.3, 1.3),
    ("the estimate alone rises", {"believed": 1.4 * MU}, 1.0, 1.06),
    ("it rises by less than shows", {"believed": 1.06 * MU}, 1.06, 1.06),
    ("it falls alone: a tenth too hard at most", {"believed": 0.7 * MU}, 0.91, 0.94),
    ("it falls, as the linings do", {"believed": 0.7 * MU, "true": 0.7 * MU}, 0.7, 0.7),
    ("it falls while nobody judges", {"believed": 0.7 * MU, "calm": False}, 0.7, 0.7),
    ("it rises while the linings rub less", {"believed": 1.4 * MU, "true": 0.85 * MU}, 0.85, 0.91),
    ("linings that have gone are not made up for", {"true": 0.5 * MU}, 0.69, 0.71),
    ("the car stands", {"reads": DECEL, "speed": 0.0}, 1.0, 1.0),
    (
        "it rises by an accelerometer that the wheels deny",
        {"believed": 1.15 * MU, "reads": -0.6, "offset": -0.6},
        1.0,
        1.06,
    ),
    (
        "it rises by one whose scale the wheels deny",
        {"believed": 1.15 * MU, "reads": -0.6, "scale": 0.15},
        1.0,
        1.06,
    ),
    ("a scale as usual", {"believed": 1.15 * MU, "true": 1.15 * MU, "scale": 0.02}, 1.15, 1.15),
    (
        "it reads less by a scale: no less friction than confirmed",
        {"believed": MU, "reads": 0.6, "scale": -0.15},
        1.0,
        1.0,
    ),
    (
        "the linings rub less on a road that falls away",
        {"true": 0.9 * MU, "believed": 0.9 * MU, "offset": -0.6},
        0.9,
        0.9,
    ),
    ("a wheel slips", {"believed": 1.4 * MU, "calm": False}, 1.4, 1.4),
    (
        "it reads less: no less friction than confirmed",
        {"believed": MU, "reads": 0.6, "offset": 0.6},
        1.0,
        1.0,
    ),
]


@pytest.mark.parametrize(("case", "wrong", "least", "most"), CASES, ids=[case[0] for case in CASES])
def test_what_is_used_of_an_estimate(car, case, wrong, least, most) -> None:
    car.brake(6.0, **wrong)
    used = car.law["used"] / MU
    print(used, car.state)
    assert (used >= least - 0.01).all()
    assert (used <= most + 0.01).all()


@pytest.mark.parametrize(
    ("case", "measured", "believed", "true", "used"),
    [
        ("the linings rub harder than the base", 1, 1.3, 1.3, 1.3),
        ("the estimate alone rises", 1, 1.4, 1.0, 1.05),
        ("nobody measures the deceleration", 0, 1.3, 1.3, 1.0),
        ("they rub less", 1, 0.8, 0.8, 0.8),
        ("the car is too slow for all, and nothing is confirmed", 1, 1.0, 0.7, 1.0),
    ],
)
def test_a_rise_in_the_first_braking_is_one_over_the_base(
    params, case, measured, believed, true, used
) -> None:
    car = Car(params)
    car.estimate["measured"] = measured
    car.brake(6.0, believed=believed * MU, true=true * MU)
    assert car.law["used"] == pytest.approx([used * MU] * 4, rel=0.015)


@pytest.mark.parametrize(("true", "used"), [(1.0, 1.0), (0.5, 0.7)])
def test_a_lining_that_is_not_observed_brakes_with_what_is_in_use_less_what_is_taken_back(
    car, true, used
) -> None:
    """Its friction at the start of the last application was another one than at its end."""
    car.law["start"], car.estimate["observed_s"] = 1.1, 0.0
    car.brake(6.0, believed=1.4 * MU, true=true * MU)
    assert car.law["used"] == pytest.approx([used * MU] * 4, rel=0.015)


def test_a_rise_that_is_a_lie_takes_more_than_a_tenth_for_less_than_a_second(car) -> None:
    """The friction in use moves by half a unit a second at most, there and back."""
    assert car.brake(0.9, believed=1.5 * MU) == pytest.approx(0.79, abs=0.02)
    assert car.brake(5.0, believed=1.5 * MU) > 0.9


@pytest.mark.parametrize("true", [1.1, 1.15, 1.2])
def test_what_is_taken_back_before_any_friction_was_confirmed_does_not_overshoot(params, true) -> None:
    """Hydraulics and car are seen 0.25 s late: force beyond the demand may be more than tyres can give."""
    car = Car(params)
    car.brake(0.8, believed=1.12 * true * MU, true=true * MU)
    car.most = 0.0
    car.brake(3.0, believed=1.12 * true * MU, true=true * MU)
    assert (car.law["used"] < 1.08 * true * MU).all()
    assert car.most < 1.01


@pytest.mark.parametrize(("slowness", "most"), [(4.0, 0.95), (1.0, 1.008)])
def test_hydraulics_that_are_slower_are_waited_for(params, slowness, most) -> None:
    """Four times as late as usual; known to be, the force returns to what is aimed at and no further."""
    car = Car(params, 0.1 + 3.0 * 0.063, slowness)
    car.brake(0.8, believed=1.5 * MU, true=1.15 * MU)
    car.most = 0.0
    car.brake(4.0, believed=1.5 * MU, true=1.15 * MU)
    assert car.most == pytest.approx(most, abs=0.003)


def test_the_next_braking_begins_with_what_was_confirmed(car) -> None:
    learned = np.zeros(1, LEARNED)[0]
    learned["mu_b"] = 1.5 * MU
    car.brake(5.0, believed=1.5 * MU)
    set_base(car.p, car.law, learned)
    assert car.law["base"] == pytest.approx([MU] * 4, rel=0.08)


def test_an_estimate_that_is_right_again_is_used_again(car) -> None:
    car.brake(3.0, believed=1.5 * MU)
    car.brake(25.0, believed=1.2 * MU, true=1.2 * MU)
    assert car.state["back"] == 0.0
    assert car.law["used"] == pytest.approx([1.2 * MU] * 4, rel=0.01)


@pytest.mark.parametrize(("decel", "judged"), [(1.9, False), (2.1, True), (math.nan, False)])
def test_a_weak_braking_says_nothing(params, decel, judged) -> None:
    car = Car(params)
    car.brake(3.0, decel=decel)
    assert (car.state["friction"] > 0.0).all() == judged


@pytest.mark.parametrize(("measured", "confirmed"), [(1, True), (0, False)])
def test_until_a_friction_was_confirmed_an_accelerometer_is_needed(params, measured, confirmed) -> None:
    car = Car(params)
    car.estimate["measured"] = measured
    car.brake(3.0)
    assert (car.state["friction"] > 0.0).all() == confirmed


@pytest.mark.parametrize(
    ("case", "believed", "true", "slope", "used"),
    [
        ("the estimate alone rises", 1.4, 1.0, 0.0, 1.05),
        ("the linings rub harder", 1.2, 1.2, 0.0, 1.2),
        ("they rub harder, and the road falls away", 1.2, 1.2, 0.6, 1.08),
        ("they rub less", 0.8, 0.8, 0.0, 0.8),
    ],
)
def test_the_wheels_tell_while_the_accelerometer_is_left_out(car, case, believed, true, slope, used) -> None:
    car.estimate["measured"] = 0
    car.brake(6.0, believed=believed * MU, true=true * MU, slope=slope)
    assert car.law["used"] == pytest.approx([used * MU] * 4, rel=0.02)


def test_what_an_accelerometer_took_is_given_again_once_it_is_left_out(car) -> None:
    """It reads 1 m/s^2 less, until the other sensors deny it."""
    car.brake(1.0, reads=1.0)
    assert car.state["back"] > 0.5
    car.estimate["measured"] = 0
    car.brake(0.3, reads=0.0)
    assert 0.9 < car.state["back"] <= 1.0  # nothing below what was confirmed
    assert car.law["used"] == pytest.approx(np.full(4, MU), rel=0.02)
