"""The car in a result's metadata: what goes in comes out, in the units that it says."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from brakelab.results.car import RATES, car_of, unpacked
from ecu.settings.config import load_config

SUV = Path("config/suv.toml")


def test_car_of_the_thesis() -> None:
    config = load_config(SUV)
    car = unpacked(json.dumps(car_of(config)))
    assert car is not None
    front = config.front
    # 2 A_k r_eff with bar in Pa.
    gain = 2.0 * front.pistons * math.pi / 4.0 * front.piston_diameter**2 * front.effective_radius * 1e5
    assert car.gain[0] == pytest.approx(gain)
    assert car.pad_area[0] == pytest.approx(2e6 * front.pad.area)
    assert car.rear_axle == pytest.approx(config.vehicle.wheelbase - config.vehicle.front_axle)
    assert [load.name for load in car.loads] == ["unladen", "laden"]
    ideal = (car.rear_axle + RATES * car.cog_height) / car.wheelbase
    assert np.all(np.array(car.share) >= ideal - 1e-3)


def test_linings_not_named_have_no_area() -> None:
    config = load_config(SUV)
    for axle in (config.front, config.rear):
        axle.model_fields_set.discard("pad")
    car = unpacked(json.dumps(car_of(config)))
    assert car is not None
    assert np.isnan(car.pad_area).all()


@pytest.mark.parametrize(
    "text", ["{", "[]", "{}", '{"mass": 1}', '{"share": [1]}', '{"loads": [[1]]}', '{"gain": [1]}']
)
def test_damage(text: str) -> None:
    with pytest.raises((ValueError, TypeError)):
        unpacked(text)


def test_a_result_without_a_car() -> None:
    assert unpacked("") is None
