"""The book of predictions: what it judges, by what, and when learning is given up.

A car of the first table obeys the balance of forces with the friction, mass and drive that its row names; of
the others only the errors of two predictions are given, with what was learned and with what is configured.
"""

import math
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import BIAS, DRAG, JOINT_STATE, LEVEL, MASS, MOTOR, OVERRUN, V
from ecu.algorithm.estimation.joint.prediction import (
    CONFIGURED,
    LEARNED,
    PREDICTION_STATE,
    add_window,
    begin_prediction,
    close_book,
    end_prediction,
)
from ecu.contract.params import BAR, GRAVITY

WINDOWS = 20
SPEED, PRESSURES = 20.0, np.array([30.0, 30.0, 20.0, 20.0])  # m/s, bar above push-out
TRUTHS: list[tuple[str, dict[str, float], float]] = [
    # what the car is, what is known of it, configured prediction over measured less 1
    ("as configured", {}, 0.0),
    ("linings 20 % smooth, learned", {"mu": 0.8}, 1.0 / 0.8 - 1.0),
    ("linings 20 % rough, learned", {"mu": 1.2}, 1.0 / 1.2 - 1.0),
    # The configured car takes the linings' force over its own mass, and feels all resistance over it.
    ("a tenth heavier, learned", {"mass": 1.1}, math.nan),
    ("accelerometer 0.1 off, learned", {"bias": 0.1}, math.nan),
    ("an engine drags by 0.3, learned", {"overrun": 0.3}, math.nan),
    ("motors give 1.2 of what they report", {"motor": 1.2}, math.nan),
    ("air drag half as much again", {"drag": 1.5}, math.nan),
]


def new_book() -> Any:
    return np.zeros(1, PREDICTION_STATE)[0]


class Braking:
    """A car that is what it is, and a joint observer that knows it."""

    def __init__(self, params, feed, motors: float = 100.0, **true: float) -> None:
        self.params, self.inputs = params[0], feed(accelerator_position=0.0)
        self.joint, self.book = np.zeros(1, JOINT_STATE)[0], new_book()
        p, x, w = params[0], self.joint["x"], self.joint["window"]
        mu, mass, motor, drag = (true.get(name, 1.0) for name in ("mu", "mass", "motor", "drag"))
        bias, overrun = true.get("bias", 0.0), true.get("overrun", 0.0)
        x[V], x[BIAS], x[OVERRUN], x[MASS] = SPEED, bias, overrun, math.log(mass)
        x[LEVEL : LEVEL + 4], x[MOTOR], x[DRAG] = math.log(mu), math.log(motor), math.log(drag / mass)
        acting = 2.0 * p["piston_area"] * p["effective_radius"] * PRESSURES * BAR
        linings = float((acting * p["mu_nominal"] * mu / p["wheel_radius"]).sum())
        self.kilograms = float(p["mass"] * mass)
        resistance = p["drag_area"] * drag * SPEED**2 + p["rolling_resistance"] * self.kilograms * GRAVITY
        driven = float((motors * motor / p["wheel_radius"]).sum()) + self.kilograms * overrun
        # A heavier car has heavier wheels: so the observer takes it, for it cannot tell them apart.
        turning = mass * (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
        felt = (linings + resistance + driven) / (self.kilograms + turning)
        self.linings = linings / self.kilograms
        w["balanced"], w["common_pressure"], w["motor"], w["common_accel"] = 1, PRESSURES, motors, bias - felt

    def run(self, windows: int = WINDOWS) -> bool:
        begin_prediction(self.params, self.book, self.joint)
        for _ in range(windows):
            add_window(self.params, self.book, self.joint, self.inputs[0])
        return bool(end_prediction(self.book))


@pytest.mark.parametrize(("case", "true", "configured"), TRUTHS, ids=[row[0] for row in TRUTHS])
def test_a_car_that_is_known_is_predicted_without_error(params, feed, case, true, configured) -> None:
    car = Braking(params, feed, **true)
    car.run()
    book = car.book
    assert book["measured"][LEARNED] / WINDOWS == pytest.approx(car.linings, rel=1e-6)
    assert book["error"][LEARNED] == pytest.approx(0.0, abs=1e-6)
    assert book["applications"] == 1
    if math.isnan(configured):
        assert abs(book["error"][CONFIGURED]) > 0.005, case
    else:
        assert book["error"][CONFIGURED] == pytest.approx(configured, abs=1e-6), case


def test_it_is_predicted_with_what_was_known_before_the_braking(params, feed) -> None:
    car = Braking(params, feed)
    begin_prediction(car.params, car.book, car.joint)
    car.joint["x"][LEVEL : LEVEL + 4] = 0.3
    for _ in range(WINDOWS):
        add_window(car.params, car.book, car.joint, car.inputs[0])
    end_prediction(car.book)
    assert car.book["error"] == pytest.approx([0.0, 0.0], abs=1e-6)


def _joint(**values: float) -> Any:
    def change(car: Braking) -> None:
        for name, value in values.items():
            car.joint[name] = value

    return change


def _input(name: str) -> Any:
    def change(car: Braking, feed: Any) -> None:
        feed(car.inputs, **{name: 1.0 if name.endswith("active") else 30.0})

    return change


def _slow(car: Braking) -> None:
    car.joint["x"][V] = 3.3


def _unbalanced(car: Braking) -> None:
    car.joint["window"]["balanced"] = 0


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        pytest.param(lambda car: None, True, id="a steady braking"),
        pytest.param(_joint(pressed=0.09), True, id="pressure rises by 9 %"),
        pytest.param(_joint(pressed=0.11), False, id="pressure rises by 11 %"),
        pytest.param(_joint(sliding=1), False, id="a wheel slides"),
        pytest.param(_slow, False, id="12 km/h"),
        pytest.param(_unbalanced, False, id="no new common time of the signals"),
    ],
)
def test_which_windows_count(params, feed, change, counts: bool) -> None:
    car = Braking(params, feed)
    change(car)
    car.run()
    assert car.book["samples"] == (WINDOWS if counts else 0)


@pytest.mark.parametrize("name", ["abs_active", "esp_active", "accelerator_position"])
def test_no_window_counts_while_another_brakes_or_the_driver_accelerates(params, feed, name: str) -> None:
    car = Braking(params, feed)
    _input(name)(car, feed)
    car.run()
    assert car.book["samples"] == 0


def booked(book: Any, learned: float, configured: float, decel: float = 3.0, windows: int = WINDOWS) -> bool:
    """Book an application of relative errors; return whether learning is given up."""
    book["samples"], book["measured"] = windows, windows * decel
    book["predicted"] = windows * decel * (1.0 + np.array([learned, configured]))
    return bool(end_prediction(book))


@pytest.mark.parametrize(
    ("decel", "windows", "counts"),
    [
        pytest.param(3.0, 20, 1, id="an ordinary braking"),
        pytest.param(0.82, 20, 1, id="a gentle one"),
        pytest.param(0.78, 20, 0, id="gentler: an error of it says nothing"),
        pytest.param(3.0, 8, 1, id="a short one"),
        pytest.param(3.0, 7, 0, id="shorter"),
        pytest.param(-3.0, 20, 0, id="driven"),
    ],
)
def test_which_brakings_are_booked(decel: float, windows: int, counts: int) -> None:
    book = new_book()
    booked(book, 0.1, 0.1, decel, windows)
    assert book["applications"] == counts


BOOKS: list[tuple[str, list[tuple[float, float]], int | None]] = [
    # case, errors of the brakings [%] as learned and as configured, given up after the n-th; None: never
    ("better", [(3, 10)] * 30, None),
    ("as good", [(5, -5)] * 30, None),
    ("worse by 1.5 %: no matter", [(6.5, 5)] * 30, None),
    ("worse by 5 %", [(10, 5)] * 6, 4),
    ("too few", [(30, 0)] * 3, None),
    ("worse to either side", [(10, 5), (-12, -5), (11, -5), (-10, 4)], 4),
    ("much worse once", [(3, 5), (2, 5), (40, 5), (3, 5), (2, 5), (3, 5), (2, 5), (3, 5)], None),
    ("now worse, now better: no doubt is left", [(20, 5), (5, 12)] * 8, None),
    # The mean of the difference is 10 - 17 q, its variance 17^2 q (1 - q), q = 0.9^n: n = 14.
    ("worse after thirty that were better", [(3, 10)] * 30 + [(15, 5)] * 20, 44),
]


@pytest.mark.parametrize(("case", "brakings", "given_up"), BOOKS, ids=[row[0] for row in BOOKS])
def test_learning_is_given_up_where_it_predicts_worse_beyond_doubt(case, brakings, given_up) -> None:
    book = new_book()
    found = [booked(book, 0.01 * learned, 0.01 * configured) for learned, configured in brakings]
    assert (found.index(True) + 1 if any(found) else None) == given_up, case


def test_up_to_ten_brakings_the_verdict_is_that_of_the_plain_mean_and_its_standard_error() -> None:
    rng = np.random.default_rng(11)
    verdicts = []
    for _ in range(300):
        book, errors = new_book(), rng.normal(0.0, [0.07, 0.04], (10, 2))
        for n in range(1, 11):
            given_up = booked(book, *errors[n - 1])
            worse = np.abs(errors[:n, 0]) - np.abs(errors[:n, 1])
            spread = worse.std(ddof=1) if n > 1 else 0.0
            beyond_doubt = worse.mean() > 2.5 * spread / math.sqrt(n)
            assert given_up == (n >= 4 and worse.mean() > 0.02 and beyond_doubt)
            verdicts.append(given_up)
    assert 30 < sum(verdicts) < 1500


# learned and configured sigma of a braking's error [%], share of cars that give up within 30 brakings
SHARES = [(3, 8, 0.0, 0.02), (5, 5, 0.0, 0.12), (12, 5, 0.75, 1.0)]


@pytest.mark.parametrize(("learned", "configured", "least", "most"), SHARES)
def test_how_often_learning_is_given_up(learned: float, configured: float, least: float, most: float) -> None:
    rng = np.random.default_rng(5)
    cars = 200
    given_up = 0
    for _ in range(cars):
        book = new_book()
        errors = 0.01 * rng.normal(0.0, [learned, configured], (30, 2))
        found = [booked(book, *error) for error in errors]
        given_up += any(found)
    print(f"{100 * given_up / cars:.1f} %")
    assert least <= given_up / cars <= most


def test_what_was_given_up_is_judged_no_more() -> None:
    book = new_book()
    assert [booked(book, 0.2, 0.05) for _ in range(4)] == [False, False, False, True]
    close_book(book)
    assert book["reported_s"] == 60.0
    assert [booked(book, 0.2, 0.05) for _ in range(4)] == [False, False, False, True]
