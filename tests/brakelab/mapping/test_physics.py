"""What a drive says of its signals: wheels, curves, brakes and scales of cars that no simulation made."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.logs.physics.samples import ANY_CAR
from brakelab.mapping.brakes import flags
from brakelab.mapping.curves import at_rest, curves
from brakelab.mapping.motion import motion_of, vehicle_speed, wheel_speeds
from brakelab.mapping.physics import propose
from brakelab.mapping.scale import scale_of
from brakelab.mapping.series import Series, with_signs
from ecu.contract.signals import CORNERS

Vector = NDArray[np.float64]
RATIO, UNDERSTEER, FLAT = 15.0, 2e-3, 1.5e-3  # -, s²/m², s²/m²: of the wheels' yaw rate over the true one


class Road(NamedTuple):
    """What the car does."""

    t: Vector
    speed: Vector
    change: Vector
    yaw_rate: Vector
    hand_wheel: Vector
    """deg"""
    wheels: dict[str, Series]


def series(signal: str, values: Vector, unit: str = "", message: str = "Esp", period: float = 0.02) -> Series:
    t = np.arange(len(values)) * period
    return Series(message, signal, unit, 0, period, len(np.unique(values)) <= 2, t, values)


def drive(seconds: float = 240.0, slowest: float = 5.0) -> Road:
    """Curves of 2 m/s² at every speed between `slowest` and 30 m/s, with brakings of up to 3 m/s²."""
    rng = np.random.default_rng(16)
    t = np.arange(0.0, seconds, 0.02)
    middle, half = 0.5 * (30.0 + slowest), 0.5 * (30.0 - slowest)
    speed = middle - half * np.cos(2.0 * np.pi * t / 60.0) + 0.8 * np.sin(2.0 * np.pi * t / 2.4)
    change = np.gradient(speed, 0.02)
    yaw = 2.0 * np.sin(2.0 * np.pi * t / 11.0) / np.maximum(speed, 8.0)
    turn = yaw * (1.0 + FLAT * speed**2) * ANY_CAR.track
    hand = np.degrees(yaw * ANY_CAR.wheelbase / speed * (1.0 + UNDERSTEER * speed**2)) * RATIO
    wheels = {
        corner: series(
            f"Wheel_{corner.upper()}",
            3.6 * (speed + side * 0.5 * turn) + rng.normal(0.0, 0.03, len(t)),
            "kph",
            "WheelSpeeds",
        )
        for corner, side in zip(CORNERS, (-1, 1, -1, 1), strict=True)
    }
    return Road(t, speed, change, yaw, hand, wheels)


ROAD = drive()
MOTION = motion_of(ROAD.wheels)
NAMES = {
    "Tesla": ("ESP_wheelSpeedFrL", "ESP_wheelSpeedFrR", "ESP_wheelSpeedReL", "ESP_wheelSpeedReR"),
    "Volkswagen": (
        "ESP_VL_Radgeschw_02",
        "ESP_VR_Radgeschw_02",
        "ESP_HL_Radgeschw_02",
        "ESP_HR_Radgeschw_02",
    ),
    "Subaru": ("FL", "FR", "RL", "RR"),
}


def named(names, message="Wheels", step=0.0):
    values = [ROAD.wheels[corner].value for corner in CORNERS]
    coarse = [np.round(each / step) * step if step else each for each in values]
    return [
        series(name, each, "Unit_KiloMeterPerHour", message) for name, each in zip(names, coarse, strict=True)
    ]


@pytest.mark.parametrize("maker", NAMES)
def test_wheels_are_known_by_the_names_of_many_makers(maker):
    found = wheel_speeds(named(NAMES[maker]))
    assert tuple(found[corner].signal for corner in CORNERS) == NAMES[maker]


@pytest.mark.parametrize("coarse_first", [True, False])
def test_the_finer_of_two_messages_of_the_same_names_is_taken(coarse_first):
    names = [f"WHEEL_SPEED_{corner.upper()}" for corner in CORNERS]
    sets = [named(names, "ROUGH_WHEEL_SPEED", 1.0), named(names, "WHEEL_SPEEDS", 0.01)]
    first, second = sets if coarse_first else sets[::-1]
    assert {one.message for one in wheel_speeds([*first, *second]).values()} == {"WHEEL_SPEEDS"}


@pytest.mark.parametrize("names", [("WHL_SPD_RL", "WHL_SPD_RR"), ("WheelSpeed_FL",)])
def test_a_wheel_stands_for_the_car_where_nothing_else_tells_its_speed(names):
    wheels = [series(name, 3.6 * ROAD.speed, "km/h") for name in names]
    assert vehicle_speed(wheels).signal in names
    assert vehicle_speed([*wheels, series("Speed", 3.6 * ROAD.speed, "km/h")]).signal == "Speed"


def test_axles_may_come_in_messages_of_their_own():
    wheels = named([f"WHEEL_SPEED_{corner.upper()}" for corner in CORNERS])
    apart = [one._replace(message="FRONT" if i < 2 else "REAR") for i, one in enumerate(wheels)]
    assert [wheel_speeds(apart)[corner].message for corner in CORNERS] == ["FRONT", "FRONT", "REAR", "REAR"]


YAW = np.degrees(ROAD.yaw_rate)
LATERAL = ROAD.speed * ROAD.yaw_rate


def turning(*others):
    return {one.target: one for one in curves([*ROAD.wheels.values(), *others], MOTION, ANY_CAR, set())}


def test_the_slope_at_rest_is_that_of_an_undeformed_tyre():
    t = np.arange(0.0, 200.0, 0.02)
    speed, true = 15.0 + 12.0 * np.sin(t / 20.0), np.sin(t / 2.0)
    line = at_rest(0.8 * true * (1.0 + FLAT * speed**2) + 0.001 * speed, true, speed, speed > 3.0)
    assert line.slope == pytest.approx(0.8, rel=0.01)


def test_at_one_speed_the_slope_at_rest_is_not_known():
    t = np.arange(0.0, 200.0, 0.02)
    speed, true = np.full(len(t), 20.0), np.sin(t / 2.0)
    noisy = true + np.random.default_rng(1).normal(0.0, 0.2, len(t))
    assert at_rest(noisy, true, speed, speed > 3.0) is None


@pytest.mark.parametrize("factor", [1.0, -1.0])
def test_a_yaw_rate_in_a_unit_keeps_its_scale(factor):
    one = turning(series("YAW_RATE", factor * YAW, "deg/s"))["yaw_rate"]
    assert (one.factor, one.unit, one.warning) == (factor, "deg/s", "")
    assert f"slope {factor:+.1f}" in one.evidence


def test_counts_without_a_unit_get_the_scale_of_the_wheels_at_walking_speed():
    one = turning(series("YawRate", YAW / 0.005))["yaw_rate"]
    assert one.unit == "deg/s"
    assert one.factor == pytest.approx(0.005, rel=0.03)
    assert "no unit" in one.warning


def test_a_magnitude_is_known_with_the_flag_that_is_its_sign():
    """Volkswagen sends the yaw rate as a magnitude; beside its sign are flags that are not."""
    flag = {
        "ESP_QBit": np.zeros(len(YAW)),
        "ESP_VZ_Gierrate": (YAW < 0.0).astype(float),
        "ESP_VZ_Lenkradw_Geschw": (np.gradient(YAW) < 0.0).astype(float),
        "ESP_Anf": (np.arange(len(YAW)) % 500 < 100).astype(float),
    }
    message = [series("ESP_Gierrate", np.abs(YAW), "Unit_DegreOfArcPerSecon")]
    message += [series(name, values)._replace(flag=True) for name, values in flag.items()]
    signed = with_signs(message)
    assert [one.sign for one in signed] == ["ESP_VZ_Gierrate"]
    assert turning(*message, *signed)["yaw_rate"].series.sign == "ESP_VZ_Gierrate"
    assert "yaw_rate" not in turning(*message)


def test_without_a_curve_names_propose_what_curves_would_tell():
    straight = [one._replace(value=3.6 * ROAD.speed) for one in ROAD.wheels.values()]
    zeros = np.random.default_rng(2).normal(0.0, 0.1, len(ROAD.t))
    others = [series("YAW_RATE", zeros, "deg/s"), series("ACCEL_BASE_ACC", zeros, "m/s2")]
    others += [series("LAT_ACCEL", zeros, "m/s2")]
    found = {one.target: one for one in propose([*straight, *others])[0]}
    assert found["yaw_rate"].series.signal == "YAW_RATE"
    assert found["accel_y"].series.signal == "LAT_ACCEL"
    assert "hardly a curve: check sign" in found["yaw_rate"].warning
    curved = [*ROAD.wheels.values(), *others]
    assert not {one.target for one in propose(curved)[0]} & {"yaw_rate", "accel_y"}


@pytest.mark.parametrize(
    ("wheel", "taken"), [("wheel_speed_{}", True), ("Wheel_{}", False)], ids=["the ECU's", "a car's"]
)
def test_names_of_the_ecu_s_inputs_count_where_the_wheels_have_them_too(wheel: str, taken: bool) -> None:
    """The angle at the road wheels is not taken for a hand wheel's, what stands still is mapped too."""
    wheels = [ROAD.wheels[corner]._replace(signal=wheel.format(corner)) for corner in CORNERS]
    straight = [one._replace(value=ROAD.speed / 0.33, unit="rad/s") for one in wheels]
    others = [
        series("steering_angle", np.zeros(len(ROAD.t)), "rad"),
        series("motor_torque_fl", -30.0 * ROAD.change, "N m", "Motor"),
        series("accelerator_position", np.maximum(ROAD.change, 0.0), "%", "Pedals"),
        series("pedal_position", np.zeros(len(ROAD.t)), "%", "Pedals"),
    ]
    found = {one.target: one for one in propose([*straight, *others])[0]}
    assert ({"motor_torque_fl", "pedal_position"} <= found.keys()) == taken
    if taken:
        assert (found["steering_angle"].factor, found["steering_angle"].warning) == (1.0, "")


def paused(one: Series, pause: float, at: float = 120.0) -> Series:
    """Return a series whose recorder, or clock, jumps ahead by `pause` [s]."""
    return one._replace(t=np.where(one.t > at, one.t + pause, one.t))


def test_a_pause_of_the_recorder_changes_nothing():
    """A straight line over 1000 s would be four times the drive."""
    sensors = [series("YAW_RATE", -YAW, "deg/s"), series("LAT_ACCEL", LATERAL, "m/s2")]
    sensors += [series("STEER_ANGLE", ROAD.hand_wheel, "deg"), series("LONG_ACCEL", -ROAD.change, "m/s2")]
    whole, _ = propose([*ROAD.wheels.values(), *sensors])
    jumped, motion = propose([paused(one, 1000.0) for one in (*ROAD.wheels.values(), *sensors)])
    assert motion is not None
    assert motion.drives
    assert [one.target for one in jumped] == [one.target for one in whole]
    assert [one.factor for one in jumped] == pytest.approx([one.factor for one in whole], rel=0.02)


def test_a_large_zero_is_taken_off():
    """A database whose offset is wrong: 10 bit around 512 with a scale of 0.02 m/s²."""
    one = turning(series("LAT_ACCEL", -501.76 - LATERAL, "m/s2"))["accel_y"]
    assert one.factor == -1.0
    assert one.offset == pytest.approx(-501.76, abs=0.1)


def test_a_usual_zero_is_left_to_the_ecu():
    assert turning(series("YAW_RATE", YAW + 0.3, "deg/s"))["yaw_rate"].offset == 0.0


SENSORS = {
    "yaw rate": [series("YAW_RATE", YAW, "deg/s")],
    "accel_y": [series("LAT_ACCEL", LATERAL, "m/s2")],
    "wheels alone": [],
}


@pytest.mark.parametrize("sensors", SENSORS)
def test_the_steering_ratio_is_that_at_rest_whatever_tells_the_curve(sensors):
    """Above all without a yaw rate: the wheels' is half as much again at 18 m/s."""
    one = turning(series("STEER_ANGLE", ROAD.hand_wheel, "deg"), *SENSORS[sensors])["steering_angle"]
    assert 1.0 / one.factor == pytest.approx(RATIO, rel=0.06)


def test_a_lateral_acceleration_is_not_blamed_for_flat_tyres():
    one = turning(series("LAT_ACCEL", LATERAL, "m/s2"))["accel_y"]
    assert (one.factor, one.warning) == (1.0, "")


@pytest.mark.parametrize(
    ("name", "on", "taken"),
    [
        ("REVERSE", lambda t: (t > 5.0) & (t < 9.0), True),
        ("REVERSE", lambda t: (t > 25.0) & (t < 35.0), False),  # at 30 m/s
        ("REVERSE", lambda t: t < -1.0, True),
        ("ReverseLampFault", lambda t: (t > 5.0) & (t < 9.0), False),
        ("GearRvs", lambda t: (t > 5.0) & (t < 9.0), True),
        ("Forward", lambda t: (t > 5.0) & (t < 9.0), False),
    ],
)
def test_a_reverse_gear_is_known_by_its_name_where_the_car_is_slow(name, on, taken):
    """Wheel speeds without a sign: a car that backs out would else be driving forwards."""
    slow = drive(slowest=1.0)
    flag = series(name, on(slow.t).astype(float))._replace(flag=True)
    inputs = {one.target: one for one in flags([flag], motion_of(slow.wheels))}
    assert ("reverse" in inputs) == taken


CASES = [
    # unit, slope, correlation, in curves -> factor, said
    ("m/s2", 1.04, 0.99, False, 1.0, ""),
    ("m/s2", -1.04, 0.99, False, -1.0, ""),
    ("m/s2", -1.45, 0.99, False, -1.0, "slope -1.45"),
    ("m/s2", 0.102, 0.99, False, 1.0, "it would fit g"),
    ("", 0.98, 0.99, False, 1.0, ""),
    ("", -41.8, 0.99, False, -0.0239, "no unit"),
    ("", 0.072, 0.83, False, 9.80665, "no unit"),  # noise explains a fifth of a slope, never nine tenths
    ("", 0.66, 0.83, False, 1.0, ""),
    ("deg/s", 0.6, 0.96, True, 1.0, ""),
    ("deg/s", 0.6, 0.96, False, 1.0, "slope +0.60"),
]


@pytest.mark.parametrize(("unit", "slope", "correlation", "in_curves", "factor", "said"), CASES)
def test_a_scale_is_the_drives_where_no_unit_tells_it(unit, slope, correlation, in_curves, factor, said):
    scale = scale_of(series("A", np.arange(9.0), unit), slope, correlation, in_curves)
    assert scale.factor == pytest.approx(factor)
    assert (said in scale.warning) if said else not scale.warning
