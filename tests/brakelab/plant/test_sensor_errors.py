"""Errors of sensors, each beside its closed form, and one line for every mistake in a file."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.description import PlantFileError, load_plant
from brakelab.plant.sensor_errors import (
    CYCLE,
    SIGNALS,
    SPEED_SOURCES,
    STANDARD,
    SensorErrors,
    disturb,
    new_sensing,
    new_sensors,
)
from brakelab.simulation.scenario import load_scenario
from ecu.errors import UserError

CONFIG = Path(__file__).parents[3] / "config"
Samples = NDArray[np.float64]


def signals(true: Any, many: int = 1, seed: int = 1, **errors: Any) -> Samples:
    """Return what `many` sensors of the same make say of `true` (one value per cycle), shape (n, many)."""
    sensors = np.repeat(new_sensors(({"accel_x": SensorErrors(**errors)},), seed)[:1], many)
    sensing, noise = np.repeat(new_sensing()[:1], many), np.random.default_rng(seed)
    rows = np.repeat(np.asarray(true, dtype=np.float64)[:, None], many, axis=1)
    for k, row in enumerate(rows):
        disturb(sensors, sensing, k * CYCLE, noise, row)
    return rows


def times(count: int) -> Samples:
    return np.arange(count) * CYCLE


@pytest.mark.parametrize(("noise", "resolution"), [(0.1, 0.0), (0.0, 0.3), (0.1, 0.3), (0.05, 0.01)])
@pytest.mark.study
def test_noise_and_resolution_add_their_variances(noise: float, resolution: float) -> None:
    true = 7.0 * math.sqrt(2.0) * times(400)  # crosses the steps at every phase
    error = signals(true, many=100, noise=noise, resolution=resolution) - true[:, None]
    assert error.var() == pytest.approx(noise**2 + resolution**2 / 12.0, rel=0.03)
    assert abs(error.mean()) < 0.004


def test_a_coarse_sensor_says_multiples_of_its_resolution() -> None:
    said = signals(np.linspace(-3.0, 3.0, 61), resolution=0.25)[:, 0] / 0.25
    assert np.array_equal(said, np.rint(said))


@pytest.mark.parametrize("delay", [0.01, 0.05, 0.6])
def test_a_delay_of_whole_cycles_is_a_shift(delay: float) -> None:
    true = np.random.default_rng(0).normal(size=300)
    whole = round(delay / CYCLE)
    said = signals(true, delay=delay)[:, 0]
    assert np.array_equal(said[whole:], true[: len(true) - whole])
    assert np.all(said[:whole] == true[0])  # before the start all was as at the start


@pytest.mark.parametrize("delay", [0.004, 0.013, 0.1575, 0.599])
def test_a_delay_between_cycles_is_interpolated(delay: float) -> None:
    t = times(300)
    true = np.sin(2.0 * math.pi * 1.3 * t)
    said = signals(true, delay=delay)[:, 0]
    assert said == pytest.approx(np.interp(t - delay, t, true), abs=1e-12)


@pytest.mark.parametrize("bias", [0.1, -0.003])
def test_a_bias_stays(bias: float) -> None:
    true = times(50)
    assert signals(true, bias=bias)[:, 0] == pytest.approx(true + bias, abs=1e-15)


@pytest.mark.parametrize("scale", [1.03, 0.5])
def test_a_scale_multiplies_the_truth_not_the_bias(scale: float) -> None:
    true = np.linspace(-3.0, 30.0, 200)
    assert signals(true, scale=scale, bias=0.1)[:, 0] == pytest.approx(scale * true + 0.1, abs=1e-12)


def test_a_bias_with_two_bounds_is_drawn_evenly_per_car_and_corner() -> None:
    wheels = [SIGNALS.index(f"wheel_speed_{c}") for c in ("fl", "fr", "rl", "rr")]
    given = ({"wheel_speed": SensorErrors(bias=(-0.2, 0.4))},)
    drawn = np.array([new_sensors(given, seed)["bias"][wheels] for seed in range(500)])
    assert -0.2 <= drawn.min() < -0.19 < 0.39 < drawn.max() <= 0.4
    assert drawn.mean() == pytest.approx(0.1, abs=5 * 0.6 / math.sqrt(12 * drawn.size))
    assert drawn.std() == pytest.approx(0.6 / math.sqrt(12.0), rel=0.05)
    assert np.abs(np.corrcoef(drawn.T) - np.eye(4)).max() < 0.2
    assert np.array_equal(new_sensors(given, 11), new_sensors(given, 11))


@pytest.mark.parametrize("tau", [math.inf, 100.0, 2.0, 0.05])
def test_the_variance_of_drift_grows_as_it_should(tau: float) -> None:
    q, many, cycles = 0.02, 4000, 600
    given = {} if tau == math.inf else {"drift_time": tau}
    drift = signals(np.zeros(cycles), many=many, drift=q, **given)
    for k in (0, 9, 99, 599):
        t = (k + 1) * CYCLE
        expected = q**2 * t if tau == math.inf else q**2 * tau / 2.0 * (1.0 - math.exp(-2.0 * t / tau))
        assert drift[k].var() == pytest.approx(expected, rel=6.0 * math.sqrt(2.0 / many))
        assert abs(drift[k].mean()) < 5.0 * math.sqrt(expected / many)


def test_drift_forgets_with_its_time_constant() -> None:
    settled = signals(np.zeros(600), many=4000, drift=0.02, drift_time=0.5)
    correlation = np.corrcoef(settled[500], settled[540])[0, 1]
    assert correlation == pytest.approx(math.exp(-0.4 / 0.5), abs=0.05)


@pytest.mark.parametrize(("begin", "length"), [(0.01, 1.0), (0.05, 4.0), (0.002, 30.0), (0.3, 2.0)])
def test_share_and_bursts_of_dropout(begin: float, length: float) -> None:
    gone = np.isnan(signals(np.zeros(4000), many=400, dropout=begin, dropout_length=length))
    starts = np.count_nonzero(gone[1:] & ~gone[:-1])
    share, mean = gone.mean(), np.count_nonzero(gone) / starts
    print(f"share {share:.4f}, burst {mean:.2f} samples, {starts} bursts")
    assert share == pytest.approx(begin * length / (1.0 + begin * length), rel=0.05)
    assert mean == pytest.approx(length, rel=0.05)
    assert starts / np.count_nonzero(~gone[:-1]) == pytest.approx(begin, rel=0.05)


@pytest.mark.parametrize(("period", "interval"), [(0.03, 3), (0.1, 10), (0.01, 1), (1.0, 100)])
def test_a_slow_sensor_is_silent_between_its_samples(period: float, interval: int) -> None:
    true = times(1000)
    said = signals(true, period=period)[:, 0]
    there = np.flatnonzero(~np.isnan(said))
    assert np.array_equal(there, np.arange(0, 1000, interval))
    assert np.array_equal(said[there], true[there])


def test_33_hz_is_33_samples_a_second() -> None:
    there = np.flatnonzero(~np.isnan(signals(times(1000), period=1.0 / 33.0)[:, 0]))
    assert len(there) == 330
    assert set(np.diff(there)) == {3, 4}


def test_dropout_takes_samples_not_cycles() -> None:
    said = signals(times(20_000), period=0.1, dropout=0.2, dropout_length=3.0)[:, 0]
    gone = np.isnan(said)
    assert gone.reshape(-1, 10)[:, 1:].all()
    assert gone[::10].mean() == pytest.approx(0.6 / 1.6, abs=0.06)


@pytest.mark.parametrize("since", [0.0, 0.5, 1.23])
def test_a_lost_sensor_says_nothing_from_then_on(since: float) -> None:
    said = signals(times(200), lost_from=since)[:, 0]
    assert np.array_equal(np.isnan(said), times(200) >= since)


def test_a_stuck_sensor_repeats_its_last_sample_noise_and_all() -> None:
    said = signals(times(200), noise=0.1, stuck_from=0.5)[:, 0]
    assert np.all(said[50:] == said[49])
    assert said[48] != said[49]
    assert np.all(signals(1.0 + times(20), stuck_from=0.0) == 1.0)  # stuck at its first


@pytest.mark.parametrize(
    ("source", "interval", "youngest", "oldest", "noise"),
    [("ideal", 1, 0.0, 0.0, 0.027), ("optical", 1, 0.008, 0.008, 0.01), ("gnss", 10, 0.1, 0.2, 0.027)],
)
def test_age_and_rate_of_the_speed_over_ground(
    source: str, interval: int, youngest: float, oldest: float, noise: float
) -> None:
    """The age is read off a ramp of 8 m/s^2."""
    place, accel, cars, ages = SIGNALS.index("vehicle_speed"), 8.0, 60, []
    for seed in range(cars):
        sensors = new_sensors(({"vehicle_speed": SPEED_SOURCES[source]},), seed)[place : place + 1]
        assert sensors["noise"] == noise
        sensors["noise"] = 0.0
        sensing, row = new_sensing()[:1], np.empty(1)
        said = []
        for t in times(101):
            row[:] = accel * t
            disturb(sensors, sensing, t, np.random.default_rng(0), row)
            said.append(row[0])
        there = np.flatnonzero(~np.isnan(said))
        assert np.array_equal(there, np.arange(0, 101, interval))
        ages.append(1.0 - said[-1] / accel)
    assert youngest - 1e-9 <= min(ages) <= max(ages) <= oldest + 1e-9
    assert np.ptp(ages) >= 0.9 * (oldest - youngest)
    assert np.mean(ages) == pytest.approx(0.5 * (youngest + oldest), abs=0.015)


def test_no_source_no_speed() -> None:
    place = SIGNALS.index("vehicle_speed")
    sensors = new_sensors((STANDARD, {"vehicle_speed": SPEED_SOURCES["none"]}), 0)
    values = np.zeros(len(SIGNALS))
    disturb(sensors, new_sensing(), 0.0, np.random.default_rng(0), values)
    assert np.array_equal(np.flatnonzero(np.isnan(values)), [place])


def test_what_is_nearer_to_the_drive_goes_before_what_is_farther() -> None:
    car = {"wheel_speed": SensorErrors(noise=0.2, bias=1.0), "wheel_speed_rl": SensorErrors(bias=3.0)}
    scenario = {"wheel_speed": SensorErrors(resolution=0.5), "wheel_speed_fl": SensorErrors(noise=0.0)}
    sensors = new_sensors((STANDARD, car, scenario), 0)
    found = {name: sensors[SIGNALS.index(f"wheel_speed_{name}")] for name in ("fl", "fr", "rl")}
    assert [found[name]["noise"] for name in found] == [0.0, 0.2, 0.2]
    assert [found[name]["bias"] for name in found] == [1.0, 1.0, 3.0]
    assert [found[name]["resolution"] for name in found] == [0.5, 0.5, 0.5]
    assert sensors[SIGNALS.index("accel_x")]["noise"] == STANDARD["accel_x"].noise


MISTAKES = [
    ("[sensor.acel_x]\nbias = 0.1", "sensor", "'acel_x' is no sensor; name one of accel_x"),
    ("[sensor.accel_x_fl]\nbias = 0.1", "sensor", "no sensor"),
    ("[sensor.accel_x]\noffset = 0.1", "sensor.accel_x.offset", ""),
    ("[sensor.accel_x]\nnoise = -0.1", "sensor.accel_x.noise", "0"),
    ("[sensor.accel_x]\nnoise = inf", "sensor.accel_x.noise", "finite"),
    ("[sensor.yaw_rate]\ndelay = 0.7", "sensor.yaw_rate.delay", "0.6"),
    ("[sensor.yaw_rate]\nbias = [0.2, 0.1]", "sensor.yaw_rate.bias", "lower bound first"),
    ("[sensor.yaw_rate]\ndropout = 1.1", "sensor.yaw_rate.dropout", "1"),
    ("[sensor.yaw_rate]\ndropout_length = 0.5", "sensor.yaw_rate.dropout_length", "1"),
    ("[sensor]\naccel_x = 3", "sensor.accel_x", ""),
]


@pytest.mark.parametrize(("text", "place", "said"), MISTAKES)
def test_a_mistake_in_a_scenario_is_one_line(tmp_path: Path, text: str, place: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"{(CONFIG / 'scenarios' / 'stop-1.toml').read_text()}\n{text}\n")
    with pytest.raises(UserError) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(f"{path}: {place}")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "place", "said"), MISTAKES)
def test_a_mistake_in_a_plant_file_is_one_line(tmp_path: Path, text: str, place: str, said: str) -> None:
    path = tmp_path / "car.toml"
    plain = (CONFIG / "plant" / "suv.toml").read_text()
    path.write_text(plain + text.replace("[sensor]\n", "") + "\n")
    (tmp_path / "linings.toml").write_text((CONFIG / "plant" / "linings.toml").read_text())
    with pytest.raises(PlantFileError) as caught:
        load_plant(path)
    assert caught.value.place.startswith(place)
    assert said in caught.value.remedy
    assert "\n" not in str(caught.value)
