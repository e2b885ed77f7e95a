"""Physics of a log: copies of a simulated drive, each with one error; the right one gives no line."""

from collections.abc import Callable

import numpy as np
import pytest

from brakelab.logs.physics.judge import judge, range_lines
from brakelab.logs.physics.samples import ANY_CAR, SAMPLED, Car, Collector, InputSeries, car_of
from brakelab.logs.signal_file import freshness_at_any_rate
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.configured import shipped
from brakelab.simulation.ecu_inputs import ecu_inputs, vehicle_frames
from ecu.contract.signals import INPUT, INPUT_SIGNALS
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

Samples = np.ndarray
PLACE = {INPUT_SIGNALS[place].name: column for column, place in enumerate(SAMPLED)}
WHEELS = [PLACE[f"wheel_speed_{corner}"] for corner in ("fl", "fr", "rl", "rr")]
PRESSURES = [PLACE[f"calliper_pressure_{corner}"] for corner in ("fl", "fr", "rl", "rr")]
SUV = car_of(new_params(load_config(resource("config/suv.toml")))[0])
RADIUS = float(SUV.radius.mean())


@pytest.fixture(scope="module")
def right() -> Samples:
    """Two hundred seconds of ordinary driving, as the ECU takes them from the frames."""
    loop = new_loop(shipped("ordinary"), load_config(resource("config/suv.toml")), 0)
    inputs = ecu_inputs(vehicle_frames(run(loop, seconds=200.0).frames), 20_000)
    return np.where(inputs["new"][:, SAMPLED] != 0, inputs["value"][:, SAMPLED], np.nan)


def collected(samples: Samples) -> InputSeries:
    """Collect samples; those outside their range are refused before, as `receive` does."""
    low = np.array([INPUT_SIGNALS[place].low for place in SAMPLED])
    high = np.array([INPUT_SIGNALS[place].high for place in SAMPLED])
    collector = Collector()
    for begin in range(0, len(samples), 4096):
        block = samples[begin : begin + 4096]
        collector.add(np.where((block >= low) & (block <= high), block, np.nan))
    return collector.series()


def lines_of(samples: Samples, car: Car) -> list[str]:
    return judge(collected(samples), car).lines


def times(columns: list[int], factor: float, offset: float = 0.0) -> Callable[[Samples], None]:
    def change(samples: Samples) -> None:
        samples[:, columns] = factor * samples[:, columns] + offset

    return change


def exchange(a: list[int], b: list[int]) -> Callable[[Samples], None]:
    def change(samples: Samples) -> None:
        samples[:, a + b] = samples[:, b + a]

    return change


def clip(columns: list[int], share: float) -> Callable[[Samples], None]:
    """Clip at a share of the greatest size, as a sensor of too small a range does."""

    def change(samples: Samples) -> None:
        end = share * np.nanpercentile(np.abs(samples[:, columns]), 99.9)
        samples[:, columns] = np.clip(samples[:, columns], -end, end)

    return change


def freeze(column: int, begin: float, seconds: float) -> Callable[[Samples], None]:
    def change(samples: Samples) -> None:
        part = samples[int(100 * begin) : int(100 * (begin + seconds)), column]
        part[np.isfinite(part)] = part[np.isfinite(part)][0]

    return change


ACCEL_X, ACCEL_Y, YAW, STEERING = (
    [PLACE[name]] for name in ("accel_x", "accel_y", "yaw_rate", "steering_angle")
)
DEGREES = 180.0 / np.pi
WRONG = [
    # what is wrong, how the signals come out, what the line begins with, what it advises
    ("accel_x turned", times(ACCEL_X, -1.0), "accel_x: turned against dv/dt", "factor = -1"),
    ("accel_x in g", times(ACCEL_X, 1 / 9.80665), "accel_x: reads ", 'unit = "g"'),
    ("accel_x 25 % more", times(ACCEL_X, 1.25), "accel_x: reads 1.2", "check unit and factor"),
    ("accel_x off by 0.6", times(ACCEL_X, 1.0, 0.6), "accel_x: reads +0.6", "offset = -0.6"),
    ("accel_y turned", times(ACCEL_Y, -1.0), "accel_y: turned", "factor = -1"),
    ("accel_y in g", times(ACCEL_Y, 1 / 9.80665), "accel_y: reads ", 'unit = "g"'),
    ("accel_y 25 % less", times(ACCEL_Y, 0.75), "accel_y: reads 0.8", "check unit and factor"),
    ("axes swapped", exchange(ACCEL_X, ACCEL_Y), "accel_x and accel_y are swapped", "exchange them"),
    ("yaw rate turned", times(YAW, -1.0), "yaw_rate: turned", "factor = -1"),
    ("yaw rate in deg/s", times(YAW, DEGREES), "yaw_rate: reads some 57 times", 'unit = "deg/s"'),
    ("rad/s taken for deg/s", times(YAW, 1 / DEGREES), "yaw_rate: reads a 57th", 'unit = "rad/s"'),
    ("yaw rate 25 % more", times(YAW, 1.25), "yaw_rate: reads ", "check its factor"),
    ("steering turned", times(STEERING, -1.0), "steering_angle: turned", "factor = -1"),
    ("the hand wheel's", times(STEERING, 16.0), "steering_angle: 1", "factor = 0.0"),
    ("km/h for rad/s", times(WHEELS, 3.6 * RADIUS), "wheel_speed_*: all read ", 'unit = "km/h"'),
    ("all wheels 25 % more", times(WHEELS, 1.25), "wheel_speed_*: all read 1.2", "rolling_radius"),
    ("a wheel 25 % less", times(WHEELS[2:3], 0.75), "wheel_speed_rl: reads 0.75 times", "check its unit"),
    ("left for right", exchange(WHEELS[::2], WHEELS[1::2]), "wheel_speed_*: left and right", "exchanged"),
    ("reference in km/h", times([PLACE["vehicle_speed"]], 3.6), "vehicle_speed: reads", 'unit = "km/h"'),
    ("pressures in MPa", times(PRESSURES, 0.1), "calliper_pressure_*: the car brakes", 'unit = "MPa"'),
    ("one pressure 25 % less", times(PRESSURES[:1], 0.75), "calliper_pressure_*: front left", "25 % less"),
    ("pressures turned", times(PRESSURES, -0.1), "calliper_pressure_*: turned", "factor = -1"),
    ("pressures off by 8", times(PRESSURES, 1.0, 8.0), "calliper_pressure_*: reads +8.", "add -8."),
    ("accel_x clipped", clip(ACCEL_X, 0.5), "accel_x: stands at -", "its range ends there"),
    ("accel_y clipped", clip(ACCEL_Y, 0.5), "accel_y: stands at ", "its range ends there"),
    ("a wheel's range too small", clip(WHEELS[1:2], 0.7), "wheel_speed_fr: stands at ", "its range ends"),
    ("a wheel frozen", freeze(WHEELS[2], 60.0, 40.0), "wheel_speed_rl: stands at ", "frozen"),
    ("pressures clipped", clip(PRESSURES, 0.4), "calliper_pressure_*: fl fr rl rr stand", "more range"),
]  # fmt: skip


def test_an_ecu_that_compensates_unequal_linings_exchanges_no_axles(right: Samples) -> None:
    """The same brake forces with front linings 30 % stronger and rear ones 30 % weaker than configured."""
    samples = np.vstack([right, right])  # enough hard braking
    times(PRESSURES[:2], 1.0 / 1.3)(samples)
    times(PRESSURES[2:], 1.0 / 0.7)(samples)
    assert [line for line in lines_of(samples, SUV) if "exchanged" in line] == []


@pytest.mark.parametrize(("case", "change", "begins", "advises"), WRONG, ids=[case[0] for case in WRONG])
def test_a_wrong_copy_gives_its_line_alone(right: Samples, case, change, begins, advises) -> None:
    wrong = right.copy()
    change(wrong)
    lines = lines_of(wrong, SUV)
    assert len(lines) == 1, lines
    assert lines[0].startswith(begins)
    assert advises in lines[0]


@pytest.mark.parametrize("car", [SUV, ANY_CAR], ids=["the car", "any car"])
@pytest.mark.parametrize(
    "without", [[], ["vehicle_speed"], ["yaw_rate"], ["accel_y"], ["steering_angle"], ["accel_x"]]
)
def test_the_right_copy_gives_none(right: Samples, car: Car, without: list[str]) -> None:
    samples = right.copy()
    samples[:, [PLACE[name] for name in without]] = np.nan
    assert lines_of(samples, car) == []


@pytest.mark.parametrize(
    "case", ["km/h for rad/s", "all wheels 25 % more", "accel_x turned", "yaw rate 25 % more"]
)
def test_a_wrong_copy_without_a_reference_gives_the_same_line(right: Samples, case: str) -> None:
    (change, begins, advises) = next(row[1:] for row in WRONG if row[0] == case)
    wrong = right.copy()
    wrong[:, PLACE["vehicle_speed"]] = np.nan
    change(wrong)
    (line,) = lines_of(wrong, SUV)
    assert line.startswith(begins)
    assert advises in line


def test_two_witnesses_that_disagree_are_both_named(right: Samples) -> None:
    wrong = right.copy()
    wrong[:, [PLACE[name] for name in ("vehicle_speed", "accel_y", "steering_angle")]] = np.nan
    wrong[:, ACCEL_X + YAW] *= (1.25, -1.0)
    accel_x, yaw_rate = lines_of(wrong, SUV)
    assert accel_x.startswith("accel_x: reads 1.2")
    assert "or those of the wheels" in accel_x
    assert yaw_rate.startswith("yaw_rate: turned")
    assert "unless left and right" in yaw_rate


@pytest.mark.parametrize(("factor", "starts"), [(1.0, []), (1.25, ["accel_x: reads 1.2"])])
def test_a_driven_axle_that_slips_hides_no_scale(right: Samples, factor: float, starts: list[str]) -> None:
    slipping = right.copy()
    slipping[:, WHEELS[2:]] *= 1.0 + 0.15 * np.clip(np.nan_to_num(right[:, ACCEL_X]), 0.0, 1.0)
    slipping[:, ACCEL_X] *= factor
    slipping[:, PLACE["vehicle_speed"]] = np.nan
    lines = lines_of(slipping, SUV)
    assert all(line.startswith(begins) for line, begins in zip(lines, starts, strict=True))


def test_a_turned_pressure_falls_out_of_its_range() -> None:
    freshness = freshness_at_any_rate()
    freshness["taken"] = 1000
    freshness["outside"][[INPUT[f"calliper_pressure_{corner}"] for corner in ("fl", "fr")]] = 90
    freshness["outside"][INPUT["accel_x"]] = 3
    (line,) = range_lines(freshness)
    assert line.startswith(
        "calliper_pressure_fl 8 %, calliper_pressure_fr 8 % of samples outside -10…250 bar"
    )


def test_a_car_that_stands_is_not_judged(right: Samples) -> None:
    standing = right.copy()
    standing[:, WHEELS] = 0.0
    standing[:, ACCEL_X] *= -1.0
    assert lines_of(standing, SUV) == []


@pytest.mark.parametrize("noise", [0.1, 1.8])
def test_pressures_of_a_drive_without_a_braking_are_not_judged(right: Samples, noise: float) -> None:
    """On the motors alone the car slows down too: released brakes are no signal of something else."""
    samples = right.copy()
    random = np.random.default_rng(4)
    samples[:, PRESSURES] = random.normal(0.5, noise, (len(samples), 4))
    collector = Collector()
    collector.add(samples)
    judged = judge(collector.series(), SUV)
    assert not judged.lines
    assert "calliper_pressure" not in judged.checked


@pytest.mark.parametrize(
    ("factor", "car", "line"),
    [
        (0.95, SUV, "vehicle_speed: reads 0.95 times what wheels of CONFIG's radii roll; multiply unloaded"),
        (1.03, SUV, "vehicle_speed: reads 1.03 times what wheels of CONFIG's radii roll; multiply unloaded"),
        (0.99, SUV, ""),
        (0.95, ANY_CAR, ""),
    ],
)
def test_radii_of_config_that_a_reference_contradicts(
    right: Samples, factor: float, car: Car, line: str
) -> None:
    samples = right.copy()
    samples[:, PLACE["vehicle_speed"]] *= factor
    found = judge(collected(samples), car)
    assert not found.contradictions
    assert [one.startswith(line) for one in found.flaws] == [True] * bool(line)
