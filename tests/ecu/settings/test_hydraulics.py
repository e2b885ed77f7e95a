"""The thesis's hydraulic unit unless CONFIG has another."""

from pathlib import Path

import pytest

from ecu.contract.params import FALL, RISE
from ecu.settings.config import load_config, new_params
from ecu.settings.hydraulics import Hydraulics, set_hydraulics
from ecu.settings.resources import resource


def test_without_a_section_it_is_that_of_the_thesis(params):
    row = params[0]
    assert row["pressure_inertia"].tolist() == [0.00075, 0.00021]
    assert row["pressure_lag"].tolist() == [0.037, 0.045]
    assert row["dead_time"].tolist() == [0.026, 0.015]
    assert row["pressure_rate"].tolist() == [18000.0, 18000.0]
    assert row["slowness"] == 1.0


@pytest.mark.parametrize(
    ("keys", "slowness"),
    [
        ({"dead_time_rise": 0.052, "lag_rise": 0.074}, 2.0),
        ({"dead_time_rise": 0.15, "lag_rise": 0.039}, 3.0),
        ({"rise_limit": 10.0 / 0.126}, 3.0),  # 20 bar take a quarter of a second
        ({"dead_time_fall": 0.2, "lag_fall": 0.2, "fall_limit": 50.0}, 1.0),
    ],
)
def test_slowness_is_that_of_a_rise(params, keys, slowness):
    set_hydraulics(params[0], Hydraulics(**keys))
    assert params["slowness"] == pytest.approx(slowness, rel=0.02)


def test_the_damping_of_a_step_stays(params):
    set_hydraulics(params[0], Hydraulics(lag_rise=0.1, lag_fall=0.02))
    lag, inertia = params["pressure_lag"][0], params["pressure_inertia"][0]
    damping = lag / (2.0 * inertia**0.5)
    assert damping[RISE] == pytest.approx(0.037 / (2.0 * 0.00075**0.5))
    assert damping[FALL] == pytest.approx(0.045 / (2.0 * 0.00021**0.5))


def test_a_file_has_the_section(tmp_path: Path):
    car = tmp_path / "car.toml"
    base = resource("config/suv.toml").read_text("utf-8")
    car.write_text(f"{base}\n[hydraulics]\ndead_time_rise = 0.15\nrise_limit = 80.0\n", "utf-8")
    row = new_params(load_config(car))[0]
    assert row["dead_time"].tolist() == [0.15, 0.015]
    assert row["pressure_rate"].tolist() == [80.0, 18000.0]
