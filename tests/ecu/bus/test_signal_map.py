"""Signal maps: what they turn recorded cars into, and the line that each mistake gives."""

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from numpy.typing import NDArray

from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.receive_plan import messages_by_contract
from ecu.bus.signal_map import MappedBus, load_signal_map, receive_plan
from ecu.bus.units import CONVERSIONS, conversion
from ecu.contract.records import INPUTS, RecordArray, new_record
from ecu.contract.signals import ALIVE, CYCLE_NS, INPUT, INPUT_SIGNALS, VALID
from ecu.errors import UserError
from ecu.settings.resources import resource

ReadLog = Callable[[Path, str], RecordArray]
CARS = ("mustang", "rav4", "kona")


@dataclass(frozen=True)
class ReceivedInputs:
    """Inputs of each cycle, shapes (cycles, inputs)."""

    value: NDArray[np.float64]
    new: NDArray[np.bool_]
    verdict: NDArray[np.uint8]
    reception: Reception

    def __getitem__(self, name: str) -> Any:
        return self.value[:, INPUT[name]]


def drive(mapped: MappedBus, frames: RecordArray) -> ReceivedInputs:
    inputs, reception = new_record(INPUTS), new_reception(mapped.plan)
    t_ns, left = int(frames["stamp_ns"][0]), 0
    rows = []
    while left < len(frames):
        begin_cycle(inputs[0], t_ns, CYCLE_NS)
        left = receive(mapped.plan, reception, frames, left, len(frames), inputs[0])
        end_cycle(inputs[0], reception.freshness)
        rows.append(inputs.copy())
        t_ns += CYCLE_NS
    whole = np.concatenate(rows)
    return ReceivedInputs(whole["value"], whole["new"].astype(bool), whole["verdict"], reception)


@pytest.fixture(scope="module")
def maps(root: Path) -> dict[str, MappedBus]:
    return {car: load_signal_map(root / "config" / "maps" / f"{car}.toml") for car in CARS}


@pytest.fixture(scope="module")
def cuts(root: Path, maps: dict[str, MappedBus], read_log: ReadLog) -> dict[str, ReceivedInputs]:
    data = root / "tests" / "data"
    return {car: drive(maps[car], read_log(data / f"{car}.log", str(maps[car].bus))) for car in CARS}


def nothing_rejected(reception: Reception) -> bool:
    return bool((reception.messages["received"] > 0).all()) and reception.totals["rejected"][0] == 0


@pytest.mark.parametrize("car", CARS)
def test_every_frame_of_a_recorded_car_is_accepted(cuts: dict[str, ReceivedInputs], car: str) -> None:
    assert nothing_rejected(cuts[car].reception)


@pytest.mark.parametrize("car", CARS)
def test_what_is_mapped_comes_alive_and_nothing_else(
    maps: dict[str, MappedBus], cuts: dict[str, ReceivedInputs], car: str
) -> None:
    alive = (cuts[car].verdict[-20] & ALIVE) != 0
    assert alive.tolist() == maps[car].plan.mapped.tolist()


SETTLED = slice(5, None)  # the first frames have come


def slope(speed: NDArray[np.float64]) -> float:
    return float(np.polyfit(np.arange(len(speed[SETTLED])) * 0.01, speed[SETTLED], 1)[0])


def test_braking_mustang(cuts: dict[str, ReceivedInputs]) -> None:
    """ISO 8855: braking is negative, wheels slow down; the sensor reads 0.4 too much at rest."""
    braking = cuts["mustang"]
    hard = braking["calliper_pressure_fl"] > 8.0
    assert hard.sum() > 50
    assert np.all(braking["accel_x"][hard] < 0.0)
    assert np.all(braking["pedal_pressed"][hard] == 1.0)
    assert np.corrcoef(braking["accel_x"], braking["calliper_pressure_fl"])[0, 1] < -0.8
    assert slope(braking["wheel_speed_fl"] * 0.336) == pytest.approx(
        braking["accel_x"][SETTLED].mean() - 0.4, abs=0.5
    )
    np.testing.assert_array_equal(braking["motor_torque_rl"], braking["motor_torque_rr"])
    assert not braking["motor_torque_fl"].any()


def test_mustang_pressures_give_the_torque_of_its_configuration(
    root: Path, cuts: dict[str, ReceivedInputs]
) -> None:
    car = tomllib.loads((root / "config" / "mustang.toml").read_text())
    torque = np.zeros(len(cuts["mustang"].value))
    for axle, wheels in (("front", ("fl", "fr")), ("rear", ("rl", "rr"))):
        brake = car[axle]
        area = brake["pistons"] * np.pi / 4 * brake["piston_diameter"] ** 2
        per_bar = 2.0 * area * brake["effective_radius"] * brake["mu_nominal"] * 1e5
        share = sum(per_bar * cuts["mustang"][f"calliper_pressure_{wheel}"] for wheel in wheels)
        torque += share
        if axle == "front":
            front = share
    np.testing.assert_allclose(torque, np.round(torque / 4.0) * 4.0, atol=0.2)  # the car's own steps of 4 N m
    np.testing.assert_allclose(front, 0.68 * torque, rtol=1e-4)


def test_decelerating_rav4(cuts: dict[str, ReceivedInputs]) -> None:
    slowing = cuts["rav4"]
    speed = np.mean([slowing[f"wheel_speed_{wheel}"] for wheel in ("fl", "fr", "rl", "rr")], 0) * 0.352
    assert -2.5 < slope(speed) < -1.5
    assert -2.5 < slowing["accel_x"][SETTLED].mean() < -1.2
    assert not slowing.new[:, INPUT["calliper_pressure_fl"]].any(), "the car sends no calliper pressure"


def test_kona_sensors_that_start_are_not_believed(cuts: dict[str, ReceivedInputs]) -> None:
    kona = cuts["kona"]
    starting = kona.verdict[:, INPUT["accel_x"]] == ALIVE | 2  # comes, at its rate, but not valid
    assert starting.sum() > 50
    for name, largest in (("accel_x", 1.0), ("accel_y", 0.6), ("yaw_rate", 0.01), ("steering_angle", 0.1)):
        assert np.abs(kona[name]).max() < largest, f"{name}: a sentinel was taken"
    assert not kona.new[starting][:, INPUT["calliper_pressure_fl"]].any(), "plausible, but declared invalid"
    assert kona.verdict[-20, INPUT["calliper_pressure_fl"]] & VALID
    assert kona["calliper_pressure_fl"][-1] == pytest.approx(20.3, abs=0.5)
    assert kona["steering_angle"][-1] == pytest.approx(np.radians(39.7 / 16.0), abs=0.002)


@pytest.mark.drives
@pytest.mark.parametrize(
    ("car", "log", "protected"),
    [
        ("mustang", "mustang/mustang_s550.candump.log", {"BrakeSnData_4": 2524}),
        (
            "rav4",
            "rav4/rav4_bus0_bus1.candump.log",
            {"KINEMATICS": 4974, "STEER_ANGLE_SENSOR": 4974, "GAS_PEDAL": 1890},
        ),
        ("kona", "kona/kona.candump.log", {"TCS11": 1085, "SAS11": 863, "ESP12": 679}),
    ],
)
def test_whole_drives_are_accepted_frame_by_frame(
    drives: Path, maps: dict[str, MappedBus], read_log: ReadLog, car: str, log: str, protected: dict[str, int]
) -> None:
    found = drive(maps[car], read_log(drives / log, str(maps[car].bus)))
    assert nothing_rejected(found.reception)
    accepted = dict(
        zip(
            maps[car].plan.messages["name"].tolist(),
            found.reception.messages["accepted"].tolist(),
            strict=True,
        )
    )
    assert {name: accepted[name] for name in protected} == protected


DATABASE = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 10 Wheels: 8 A
 SG_ v_fl : 0|16@1+ (0.01,0) [0|0] "km/h" A
 SG_ v_fr : 16|16@1+ (0.01,0) [0|0] "parsec" A
 SG_ count : 32|4@1+ (1,0) [0|0] "" A
 SG_ ok : 36|2@1+ (1,0) [0|0] "" A
 SG_ p : 48|8@1+ (100,0) [0|0] "kPa" A
"""
GOOD = """database = "car.dbc"
rolling_radius = 0.3

[messages.Wheels]
period = 0.01
counter = { signal = "count" }

[inputs]
wheel_speed_fl = { message = "Wheels", signal = "v_fl", validity = { signal = "ok", values = [1] } }
calliper_pressure_fl = { message = "Wheels", signal = "p" }
calliper_pressure_fr = { message = "Wheels", signal = "p", factor = 0.5, offset = -100, timeout = 0.5 }
"""


def write(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in GOOD
    (folder / "car.dbc").write_text(DATABASE)
    (folder / "car.toml").write_text(GOOD.replace(old, new) if old else GOOD)
    return folder / "car.toml"


def test_units_factor_offset_and_one_signal_for_two_inputs(
    tmp_path: Path, frame: Callable[..., RecordArray]
) -> None:
    mapped = load_signal_map(write(tmp_path))
    data = bytes([0x10, 0x27, 0, 0, 0x11, 0, 40, 0])  # 100 km/h, counter 1, ok 1, 4000 kPa
    found = drive(mapped, frame(10**18, 10, data))
    assert found["wheel_speed_fl"][0] == pytest.approx(100 / 3.6 / 0.3)
    assert found["calliper_pressure_fl"][0] == pytest.approx(40.0)
    assert found["calliper_pressure_fr"][0] == pytest.approx(19.0)  # 0.5 · 4000 kPa − 100 kPa
    assert mapped.plan.expected["timeout_ns"][INPUT["calliper_pressure_fr"]] == 500_000_000
    fed = [INPUT_SIGNALS[place].name for place in np.flatnonzero(mapped.plan.mapped)]
    assert fed == ["wheel_speed_fl", "calliper_pressure_fl", "calliper_pressure_fr"]
    assert mapped.bus is None


def test_a_sentinel_is_no_measurement(tmp_path: Path, frame: Callable[..., RecordArray]) -> None:
    mapped = load_signal_map(write(tmp_path, '"p" }', '"p", factor = 0.1, sentinels = [25500] }'))
    for raw, taken in ((254, True), (255, False)):
        found = drive(mapped, frame(10**18, 10, bytes([0, 0, 0, 0, 0x11, 0, raw, 0])))
        assert bool(found.new[0, INPUT["calliper_pressure_fl"]]) is taken


@pytest.mark.parametrize(("status", "expected"), [(0, 30.0), (1, -50.0), (2, 30.0)])
def test_a_magnitude_takes_its_sign_from_another_signal(
    tmp_path: Path, frame: Callable[..., RecordArray], status: int, expected: float
) -> None:
    """4000 kPa as 40 deg/s, the offset of -10 deg/s after the sign."""
    magnitude = 'sign = { signal = "ok", values = [1] }, factor = 0.01, offset = -10, unit = "deg/s" }'
    path = write(tmp_path, "calliper_pressure_fl = {", f"yaw_rate = {{ {magnitude[:-2]}, ")
    found = drive(load_signal_map(path), frame(10**18, 10, bytes([0, 0, 0, 0, 1 | status << 4, 0, 40, 0])))
    assert np.degrees(found["yaw_rate"][0]) == pytest.approx(expected)


def test_a_checksum_can_be_ignored_by_name(tmp_path: Path, frame: Callable[..., RecordArray]) -> None:
    frames = np.concatenate(
        [frame(10**18 + k * CYCLE_NS, 10, bytes([0, 0, 0, 0, 0x12, 0, 0, 0])) for k in range(5)]
    )
    strict = drive(load_signal_map(write(tmp_path)), frames)
    assert strict.reception.messages["repeated"][0] == 4
    path = write(tmp_path, 'database = "car.dbc"', 'database = "car.dbc"\nignore_checksum = ["Wheels"]')
    assert drive(load_signal_map(path), frames).reception.messages["accepted"][0] == 5


PRESSURE = "inputs.calliper_pressure_fl"
# What strict = false lets through, and a scale that cannot be
BENT = {
    "beyond its message": ("SG_ p : 48|8@1+", "SG_ p : 60|8@1+"),
    "beyond its message, big endian": ("SG_ p : 48|8@1+", "SG_ p : 62|8@0+"),
    "no scale": ("48|8@1+ (100,0)", "48|8@1+ (0,0)"),
    "longer than a frame": ("Wheels: 8", "Wheels: 100"),
}


@pytest.mark.parametrize("bent", BENT)
def test_a_signal_that_cannot_be_read(tmp_path: Path, bent: str) -> None:
    path = write(tmp_path, 'database = "car.dbc"', 'database = "car.dbc"\nstrict = false')
    (tmp_path / "car.dbc").write_text(DATABASE.replace(*BENT[bent]))
    with pytest.raises(UserError, match=r"car.dbc: Wheels\.\w+: start bit, length or scale is wrong"):
        load_signal_map(path)


@pytest.mark.parametrize("own", ["48|8@1- (100,0)", "48|8@1+ (100,-50)"], ids=["signed", "offset"])
def test_a_signal_with_a_sign_of_its_own_is_no_magnitude(tmp_path: Path, own: str) -> None:
    path = write(tmp_path, '"p" }', '"p", sign = { signal = "ok", values = [1] } }')
    (tmp_path / "car.dbc").write_text(DATABASE.replace("48|8@1+ (100,0)", own))
    with pytest.raises(UserError, match=rf"{PRESSURE}\.sign: p has a sign or an offset of its own"):
        load_signal_map(path)


MISTAKES: dict[str, tuple[str, str, str]] = {
    "unknown unit": (
        '"p" }',
        '"p", unit = "mmHg" }',
        f'{PRESSURE}.unit: "mmHg" does not turn into bar; known here: bar, Pa',
    ),
    "unit of the database": (
        '"v_fl"',
        '"v_fr"',
        'inputs.wheel_speed_fl.unit: "parsec" does not turn into rad/s',
    ),
    "unit of another kind": ('"p" }', '"v_fl" }', f'{PRESSURE}.unit: "km/h" does not turn into bar'),
    "no rolling radius": (
        "rolling_radius = 0.3",
        "",
        "rolling_radius: missing; inputs.wheel_speed_fl.unit is in km/h",
    ),
    "no such input": (
        "wheel_speed_fl =",
        "wheel_sped_fl =",
        "inputs.wheel_sped_fl: no such input; did you mean wheel_sp",
    ),
    "no such message": (
        '"Wheels", signal = "p" }',
        '"Whels", signal = "p" }',
        f"{PRESSURE}.message: the database has no message Whels; did you mean Wheels?",
    ),
    "no such signal": (
        '"p" }',
        '"pressure" }',
        f"{PRESSURE}.signal: message Wheels has no signal pressure; it has ",
    ),
    "no such validity": (
        '"ok"',
        '"okay"',
        ".validity.signal: message Wheels has no signal okay; did you mean ok?",
    ),
    "no such sign": (
        '"p" }',
        '"p", sign = { signal = "okay", values = [1] } }',
        ".sign.signal: message Wheels has no signal okay; did you mean ok?",
    ),
    "an input unlike any": (
        "wheel_speed_fl =",
        "foo_bar =",
        "inputs.foo_bar: no such input; there are wheel_",
    ),
    "unknown rule": (
        "period = 0.01",
        'period = 0.01\nchecksum = "ford"',
        'messages.Wheels.checksum: unknown rule "ford"; known',
    ),
    "no period": ("period = 0.01", "", "messages.Wheels.period: missing"),
    "period of nothing": (
        "period = 0.01",
        "period = 0",
        "messages.Wheels.period: give a value above 0 s (found 0)",
    ),
    "infinite time-out": (
        ', signal = "p" }',
        ', signal = "p", timeout = inf }',
        f"{PRESSURE}.timeout: give a finite number (found inf)",
    ),
    "time-out of an hour": (
        ', signal = "p" }',
        ', signal = "p", timeout = 3600 }',
        f"{PRESSURE}.timeout: give a value of at most 60 s (found 3600)",
    ),
    "time-out of ages": (
        ', signal = "p" }',
        ', signal = "p", timeout = 1e308 }',
        f"{PRESSURE}.timeout: give a value of at most 60 s (found 1e+308)",
    ),
    "period of ages": (
        "period = 0.01",
        "period = 1e18",
        "messages.Wheels.period: give a value of at most 60 s (found 1e+18)",
    ),
    "unused message": (
        "[messages.Wheels]",
        "[messages.W]\nperiod = 1\n[messages.Wheels]",
        "messages.W: no input and no output uses it",
    ),
    "counter too wide": ('"count" }', '"count", modulo = 17 }', "messages.Wheels.counter: count has 4 bits"),
    "nothing to ignore": (
        "rolling",
        'ignore_checksum = ["Brakes"]\nrolling',
        "ignore_checksum: Brakes has neither",
    ),
    "unknown key": ("rolling_radius", "rolling_radios", "rolling_radios: unknown key"),
    "wrong type": (
        "rolling_radius = 0.3",
        'rolling_radius = "a"',
        "rolling_radius: give a number",
    ),
    "missing key": (', signal = "p" }', " }", f"{PRESSURE}.signal: missing; add this key"),
    "map of columns": (
        ', signal = "p" }',
        ', signal = "p", column = "p" }',
        "inputs: maps columns of signal files; frames need messages",
    ),
    "no TOML": ("[inputs]", "[inputs", "not valid TOML:"),
    "no database": ('"car.dbc"', '"cat.dbc"', "cat.dbc: no such file"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_gives_one_line_with_the_key(tmp_path: Path, mistake: str) -> None:
    old, new, line = MISTAKES[mistake]
    with pytest.raises(UserError, match=re.escape(line)) as refusal:
        load_signal_map(write(tmp_path, old, new))
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path))


def test_missing_map() -> None:
    with pytest.raises(UserError, match="no such file"):
        load_signal_map(Path("nowhere.toml"))


def test_every_unit_of_the_contract_converts_into_itself() -> None:
    for signal in INPUT_SIGNALS:
        assert conversion(signal.unit, signal.unit, None, "", "") == (1.0, 0.0)
    assert CONVERSIONS["degC"]["K"] == (1.0, -273.15)
    factor, offset = conversion("degF", "degC", None, "", "")
    assert (212 * factor + offset, 32 * factor + offset) == pytest.approx((100.0, 0.0))


def test_a_rule_that_needs_more_bytes_than_the_message_has(tmp_path: Path) -> None:
    path = write(tmp_path, "period = 0.01", 'period = 0.01\nchecksum = "ford_accel_data"')
    (tmp_path / "car.dbc").write_text(DATABASE.replace("Wheels: 8", "Wheels: 7"))
    with pytest.raises(UserError, match=r"messages.Wheels.checksum: Wheels is too short for this rule"):
        load_signal_map(path)


def test_without_a_map_the_contract_is_received(tmp_path: Path) -> None:
    assert 0x60 in receive_plan(None).ids
    assert receive_plan(write(tmp_path)).ids.tolist() == [10]


@pytest.mark.parametrize("kind", ["kcd", "sym"])
def test_a_database_of_another_kind_gives_the_same_inputs(tmp_path: Path, kind: str) -> None:
    """The Mustang's DBC written by cantools as KCD (Kayak) and SYM (PEAK); both keep no cycle times."""
    dbc = resource("dbc/cars/mustang.dbc")
    database = cantools.database.load_file(dbc, strict=False)
    text = database.as_kcd_string() if kind == "kcd" else database.as_sym_string()
    (tmp_path / f"car.{kind}").write_text(text, "utf-8")
    of_dbc = resource("config/maps/mustang.toml")
    shipped = of_dbc.read_text("utf-8").replace("../../dbc/cars/mustang.dbc", f"car.{kind}")
    (tmp_path / "map.toml").write_text(shipped, "utf-8")
    other, plan = load_signal_map(tmp_path / "map.toml").plan, load_signal_map(of_dbc).plan
    for name in ("place", "scale", "offset"):
        np.testing.assert_allclose(other.signals[name], plan.signals[name])
    assert other.ids.tolist() == plan.ids.tolist()
    assert other.mapped.tolist() == plan.mapped.tolist()


MESSAGES = [
    # car, messages of its bus by those of the contract that they stand for
    (
        "rav4",
        {
            "Imu": ["KINEMATICS"],
            "Steering": ["STEER_ANGLE_SENSOR"],
            "WheelSpeed": ["WHEEL_SPEEDS"],
            "BrakeRequest": ["BRAKE_MODULE", "GAS_PEDAL"],
        },
    ),
    (
        "mustang",
        {
            "Imu": ["BrakeSnData_3"],
            "CalliperPressure": ["BrakeSnData_4"],
            "Steering": ["SteeringPinion_Data_Alt"],
            "BrakeRequest": ["EngBrakeData", "EngVehicleSpThrottle", "DesiredTorqBrk"],
            "Motor": ["VehicleOperatingModes"],
            "WheelSpeed": ["WheelSpeed"],
        },
    ),
]


@pytest.mark.parametrize(("car", "messages"), MESSAGES, ids=[row[0] for row in MESSAGES])
def test_messages_stand_for_those_of_the_contract(maps, car: str, messages: dict[str, list[str]]) -> None:
    assert messages_by_contract(maps[car].plan) == messages


def test_without_a_map_axles_share_a_name_and_our_own_frames_have_none() -> None:
    messages = messages_by_contract(receive_plan(None))
    assert messages["WheelSpeed"] == ["WheelSpeedFront", "WheelSpeedRear"]
    assert not any("Blcf" in name for names in messages.values() for name in names)
