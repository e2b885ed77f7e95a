"""The study of wear: what it measures of lives made by hand, and one short life of a made-up car."""

import numpy as np
import pytest

from brakelab.identify.wear.fit import fit_law
from brakelab.studies.wear.drives import CarDrives, Part, trip_scenario
from brakelab.studies.wear.study import LAWS, LIFE_KM, MODES, Law, Life, live
from brakelab.studies.wear.wear import determination, inside, wear_tables, wins

TRUE_LAW = np.array([0.08, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0])


def made_up_car(seed: int, lot: float) -> CarDrives:
    """Return parts whose true wear is `lot` times a law that is linear in the regressors."""
    random = np.random.default_rng(seed)
    parts = []
    for k in range(9):
        energy, heat, power = random.uniform(0.5, 1.5), random.uniform(50, 150), random.uniform(0.005, 0.03)
        column = energy * np.array([1, heat, heat**2, 0.3, 0.3 * heat, power, power * heat])
        x = np.repeat(column[:, None], 4, axis=1)
        parts.append(Part("usual", f"{k}", 25e3, lot * TRUE_LAW @ x, x, 0.05 * x, 0.01 * x))
    return CarDrives(seed, parts, np.zeros((3, 4)), np.array([[0.5] * 4, [6.0] * 4]))


@pytest.fixture(scope="module")
def law() -> Law:
    x = np.random.default_rng(0).uniform(0.5, 2.0, (12, 7)) * made_up_car(0, 1.0).parts[0].regressors[:, 0]
    fit = fit_law(x, x @ TRUE_LAW, np.full(12, 1e-6))
    return Law(np.repeat(TRUE_LAW[:, None], 4, axis=1), np.full(4, 0.15), (fit, fit))


def by_hand(said: float, sigma: float) -> Life:
    true = np.linspace(0.5, 5.0, 10)[:, None] * np.ones(4)
    points = dict.fromkeys(MODES, said * true)
    return Life(0, LAWS[0], np.arange(10.0), true, points, {mode: np.full((10, 4), sigma) for mode in MODES})


BANDS = [(1.0, 0.01, 100.0), (1.1, 0.13, 50.0), (2.0, 0.01, 0.0)]


@pytest.mark.parametrize(("said", "sigma", "share"), BANDS)
def test_the_share_of_points_inside_the_band(said, sigma, share):
    """10 % too much is 0.05 to 0.5 mm; 1.96 sigma of 0.25 mm holds half of the points."""
    assert inside([by_hand(said, sigma)], MODES[0], slice(0, 4)) == share


def test_r2_is_that_of_the_points():
    assert determination(by_hand(1.0, 0.1), MODES[0], 0) == 1.0
    life = by_hand(1.1, 0.1)
    true = life.true[:, 0]
    expected = 1.0 - np.sum((0.1 * true) ** 2) / np.sum((true - true.mean()) ** 2)
    assert determination(life, MODES[0], 0) == pytest.approx(expected)


def test_measurements_correct_a_lot_and_the_law_alone_cannot(law):
    lives = [live(made_up_car(seed, 1.2), LAWS[0], law) for seed in range(20)]
    last = {
        mode: np.array([life.predicted[mode][-1, 0] / life.true[-1, 0] - 1.0 for life in lives])
        for mode in MODES
    }
    assert np.median(last["law alone"]) < -0.10
    assert np.abs(np.median(last["every measurement"])) < 0.03
    sizes = [np.median(np.abs(last[mode])) for mode in MODES]
    assert sizes == sorted(sizes, reverse=True)
    assert inside(lives, "every measurement", slice(0, 4)) >= 90.0
    for life in lives:
        assert life.km[-1] == pytest.approx(LIFE_KM, rel=0.01)
        assert (np.diff(life.true[:, 0]) > 0).all()


def test_the_tables_have_a_row_for_law_mode_and_axle(law):
    cars = [made_up_car(seed, 1.1) for seed in range(2)]
    laws = dict.fromkeys(LAWS, law)
    lives = [live(car, name, law) for name in LAWS for car in cars]
    tables = wear_tables(cars, laws, lives)
    assert [len(table.rows) for table in tables] == [16, 4, 4]


def test_drivers_differ_in_speed_time_and_season():
    calm, lively = trip_scenario(3, "calm"), trip_scenario(3, "lively")
    ends = [scenario.trace.speed[-1][0] for scenario in (calm, lively)]
    assert ends[0] / ends[1] == pytest.approx(1.10 / 0.82)
    assert calm.ambient_temperature < lively.ambient_temperature
    assert calm.vehicle_speed == "none"


def test_a_tie_is_nobodys_win() -> None:
    """The rear's two laws are the same one: its pads say nothing about which is better."""
    assert wins(np.array([[0.9, 0.8], [0.7, 0.7]]), np.array([[0.8, 0.9], [0.7, 0.7]])) == (1, 2)
