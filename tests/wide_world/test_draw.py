"""Strangers: the same by seed and number, as wide as they should be, with CONFIGs that the product takes."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from ecu.settings.config import load_config

from .brakings import find, read
from .draw import CARS, SETS, draw
from .logger import record

pytestmark = pytest.mark.compiled


ALL = draw(1)


def test_thirty_cars_of_six_sets_are_the_same_by_seed_and_number() -> None:
    assert len(ALL) == CARS
    assert {letter: sum(one.letter == letter for one in ALL) for letter in SETS} == dict.fromkeys(SETS, 5)
    again, other = draw(1, range(7, 8))[0], draw(2, range(7, 8))[0]
    assert again.car == ALL[7].car
    assert again.nominal == ALL[7].nominal
    assert again.logger == ALL[7].logger
    assert other.car.body != ALL[7].car.body
    one, two = again.drive(), ALL[7].drive()
    np.testing.assert_array_equal(one, two)
    first = record(one, again.logger, again.nominal.radius)
    second = record(two, ALL[7].logger, ALL[7].nominal.radius)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])


def test_the_draw_is_wide() -> None:
    grip = np.array([np.mean(one.route.grip) for one in ALL])
    assert grip.min() < 0.7
    assert grip.max() > 1.25
    assert {one.car.tyre.kind for one in ALL} == {0, 1, 2}
    assert {one.car.abs_.kind for one in ALL} == {0, 1, 2}
    assert len({one.car.brake.kind for one in ALL}) == 5
    mass = np.array([one.nominal.mass / one.car.body.mass - 1.0 for one in ALL])
    assert 0.02 < np.std(mass) < 0.06
    assert np.max(np.abs(mass)) <= 0.1
    scale = [one.logger.pressure_scale for one in ALL]
    assert max(abs(s - 1.0) for s in np.ravel(scale)) > 0.03
    lag = [one.logger.speed.delay + one.logger.speed.lag for one in ALL if one.letter == "B"]
    assert all(0.16 <= one <= 0.4 for one in lag)
    assert {trait for one in ALL for trait in one.traits} >= {
        "taps",
        "left foot",
        "rain",
        "hidden slip control",
    }


@pytest.mark.parametrize("number", range(6))
def test_a_car_of_each_set_has_twenty_brakings_in_its_signals(number: int) -> None:
    one = ALL[number]
    rows = one.drive()
    signals = read(record(rows, one.logger, one.nominal.radius), one.nominal)
    brakings = find(signals, one.nominal)
    assert len(brakings) >= 20
    decel = [braking.measured for braking in brakings]
    assert 1.0 < np.median(decel) < 13.0
    assert 20.0 < rows["speed"].max() < 85.0
    assert rows["temperature"].max() < 900.0


def test_some_brake_at_12_from_the_first_braking_on() -> None:
    """The hardest 0.3 s of the first braking of the racing cars."""
    hardest = []
    for one in ALL:
        if one.letter in "ABD" and not one.rain:
            rows = one.drive()
            first = rows[(rows["applications"] == 1) & (rows["braking"] == 1)]
            hardest.append(np.max(np.convolve(-first["specific_force"], np.ones(30) / 30, "valid")))
    assert max(hardest) > 12.0


@pytest.mark.parametrize("one", ALL[:6], ids=lambda one: one.letter)
def test_the_product_takes_the_configuration(one: object, tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(one.nominal.toml("stranger"), "utf-8")
    config = load_config(path)
    assert config.vehicle.mass == pytest.approx(one.nominal.mass)
    assert config.rear.mu_nominal == pytest.approx(one.nominal.mu_nominal[1])
    assert tomllib.loads(path.read_text("utf-8"))["sensors"] == pytest.approx(one.nominal.sensors)
