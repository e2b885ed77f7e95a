"""Rows of a log: friction power, speed, rain, air and temperature as the ECU has them."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.thermal.reader import USED, as_drive, read_drives
from brakelab.logs.physics.samples import DISC_TEMPERATURE_MEASURED, KEPT
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.simulate import write_columns
from ecu.contract.signals import AMBIENT_TEMPERATURE, CORNERS, OUTPUT, RAIN, WHEEL_SPEED
from ecu.errors import UserError
from ecu.settings.config import load_config

CONFIG = load_config(Path(__file__).parents[4] / "config" / "suv.toml")
SCENARIO = Path(__file__).parents[4] / "config" / "scenarios" / "fade.toml"


def cycles(n: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """Return outputs and samples of a car that brakes with 100, 200, 300, 400 N m at 50 rad/s in 1 s of 5."""
    outputs, samples = np.zeros((n, len(USED))), np.full((n, len(KEPT)), np.nan)
    place = {
        name: USED.index(OUTPUT[name]) for name in ("vehicle_speed", "braking", "brake_torque_fl", "mu_b_fl")
    }
    outputs[:, place["vehicle_speed"]] = 18.0
    outputs[100:200, place["braking"]] = 1.0
    for i in range(4):
        outputs[:, place["brake_torque_fl"] + i] = 100.0 * (i + 1)
        outputs[:, place["mu_b_fl"] + i] = 0.4
        outputs[:, USED.index(OUTPUT["sigma_mu_b_fl"]) + i] = 0.02
        samples[::2, KEPT.index(WHEEL_SPEED) + i] = 50.0
    samples[50, KEPT.index(AMBIENT_TEMPERATURE)] = 7.0
    samples[300, KEPT.index(RAIN)] = 1.0
    samples[::10, KEPT.index(DISC_TEMPERATURE_MEASURED) + 1] = 80.0
    return outputs, samples


def test_a_second_is_the_mean_of_its_cycles() -> None:
    drive = as_drive(Path("a.csv"), *cycles(), 15.0)
    series = drive.series
    assert series.power[1] == pytest.approx(50.0 * np.array([100.0, 200.0, 300.0, 400.0]))
    assert not series.power[[0, 2, 3, 4]].any()  # nobody brakes: torque is noise
    assert series.speed == pytest.approx(18.0)
    assert series.air == pytest.approx(7.0)
    assert series.wet.tolist() == [True, True, True, True, True]  # the first word on rain holds before it
    assert series.measured[:, 1] == pytest.approx(80.0)
    assert np.isnan(series.measured[:, [0, 2, 3]]).all()
    assert (drive.applications, series.air_known, drive.rain_known) == (1, True, True)
    assert drive.friction_error == pytest.approx(0.05)


def test_what_no_sensor_says_is_the_configuration_s_or_missing() -> None:
    outputs, samples = cycles()
    samples[:, [KEPT.index(AMBIENT_TEMPERATURE), KEPT.index(RAIN)]] = np.nan
    samples[:, KEPT.index(WHEEL_SPEED) + 2] = np.nan
    drive = as_drive(Path("a.csv"), outputs, samples, 15.0)
    assert drive.series.air == pytest.approx(15.0)
    assert not drive.series.wet.any()
    assert (drive.series.air_known, drive.rain_known) == (False, False)
    assert drive.wheels_seen == pytest.approx([1.0, 1.0, 0.0, 1.0])


def test_the_power_of_a_log_is_that_of_the_closed_loop(tmp_path) -> None:
    loop = run(new_loop(load_scenario(SCENARIO), CONFIG, 1), seconds=120.0)
    columns = dict(loop.inputs)
    measured = {f"disc_temperature_measured_{c}": loop.truth[f"disc_temperature_{c}"] for c in CORNERS}
    write_columns(tmp_path / "a.parquet", loop.t, columns | measured, {})
    (drive,) = read_drives([tmp_path / "a.parquet"], CONFIG, None)
    true = [
        float(np.sum(0.01 * loop.truth[f"brake_torque_{c}"] * loop.truth[f"wheel_speed_{c}"]))
        for c in CORNERS
    ]
    assert drive.series.power.sum(axis=0) == pytest.approx(true, rel=0.15)  # by its own friction
    assert drive.series.measured[-1] == pytest.approx([m[-50] for m in measured.values()], abs=5.0)
    assert drive.applications >= 1


def test_a_log_that_cannot_be_read_is_one_line(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("", encoding="utf-8")
    with pytest.raises(UserError) as caught:
        read_drives([tmp_path / "a.csv"], CONFIG, None)
    assert "a.csv" in str(caught.value)
