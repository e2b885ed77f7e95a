"""Strangers: the same by seed and number, as wide as they should be, with CONFIGs that the product takes."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from ecu.settings.config import load_config

from .brakings import find, read
from .draw import CARS, SETS, Stranger, draw
from .logger import record

pytestmark = [pytest.mark.study, pytest.mark.compiled]


@pytest.fixture(scope="module")
def cars() -> list[Stranger]:
    return draw(1)


def test_thirty_cars_of_six_sets_are_the_same_by_seed_and_number(cars: list[Stranger]) -> None:
    assert len(cars) == CARS
    assert {letter: sum(one.letter == letter for one in cars) for letter in SETS} == dict.fromkeys(SETS, 5)
    again, other = draw(1, range(7, 8))[0], draw(2, range(7, 8))[0]
    assert again.car == cars[7].car
    assert again.nominal == cars[7].nominal
    assert again.logger == cars[7].logger
    assert other.car.body != cars[7].car.body
    one, two = again.drive(), cars[7].drive()
    np.testing.assert_array_equal(one, two)
    first = record(one, again.logger, again.nominal.radius)
    second = record(two, cars[7].logger, cars[7].nominal.radius)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])


def test_the_draw_is_wide(cars: list[Stranger]) -> None:
    grip = np.array([np.mean(one.route.grip) for one in cars])
    assert grip.min() < 0.7
    assert grip.max() > 1.25
    assert {one.car.tyre.kind for one in cars} == {0, 1, 2}
    assert {one.car.abs_.kind for one in cars} == {0, 1, 2}
    assert len({one.car.brake.kind for one in cars}) == 5
    mass = np.array([one.nominal.mass / one.car.body.mass - 1.0 for one in cars])
    assert 0.02 < np.std(mass) < 0.06
    assert np.max(np.abs(mass)) <= 0.1
    scale = [one.logger.pressure_scale for one in cars]
    assert max(abs(s - 1.0) for s in np.ravel(scale)) > 0.03
    lag = [one.logger.speed.delay + one.logger.speed.lag for one in cars if one.letter == "B"]
    assert all(0.16 <= one <= 0.4 for one in lag)
    assert {trait for one in cars for trait in one.traits} >= {
        "taps",
        "left foot",
        "rain",
        "hidden slip control",
    }


@pytest.mark.parametrize("number", range(6))
def test_a_car_of_each_set_has_twenty_brakings_in_its_signals(cars: list[Stranger], number: int) -> None:
    one = cars[number]
    rows = one.drive()
    signals = read(record(rows, one.logger, one.nominal.radius), one.nominal)
    brakings = find(signals, one.nominal)
    assert len(brakings) >= 20
    decel = [braking.measured for braking in brakings]
    assert 1.0 < np.median(decel) < 13.0
    assert 20.0 < rows["speed"].max() < 85.0
    assert rows["temperature"].max() < 900.0


def hardest(rows: np.ndarray) -> float:
    """Return the hardest 0.3 s of the first braking [m/s^2]."""
    first = rows[(rows["applications"] == 1) & (rows["braking"] == 1)]
    return float(np.max(np.convolve(-first["specific_force"], np.ones(30) / 30, "valid")))


def test_some_racing_car_brakes_at_12_from_the_first_braking_on(cars: list[Stranger]) -> None:
    racing = (one for one in cars if one.letter in "ABD" and not one.rain)
    assert any(hardest(one.drive()) > 12.0 for one in racing)


@pytest.mark.parametrize("number", range(len(SETS)), ids=SETS)
def test_the_product_takes_the_configuration(cars: list[Stranger], number: int, tmp_path: Path) -> None:
    one = cars[number]
    path = tmp_path / "car.toml"
    path.write_text(one.nominal.toml("stranger"), "utf-8")
    config = load_config(path)
    assert config.vehicle.mass == pytest.approx(one.nominal.mass)
    assert config.rear.mu_nominal == pytest.approx(one.nominal.mu_nominal[1])
    assert tomllib.loads(path.read_text("utf-8"))["sensors"] == pytest.approx(one.nominal.sensors)
