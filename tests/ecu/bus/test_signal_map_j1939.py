"""SAE J1939: the shipped van's map receives what its units send, and what it sends is received again."""

from collections.abc import Callable
from pathlib import Path

import cantools
import numpy as np
import pytest

from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.output_map import transmit_plan
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import accepted_ids
from ecu.bus.signal_map import MappedBus, load_signal_map
from ecu.bus.transmit import frame_buffer, new_transmission, transmit
from ecu.contract.records import EXTENDED_ID, FRAME_EXTENDED, INPUTS, RecordArray
from ecu.contract.signals import INPUT, N_OUTPUTS, OUTPUT, USABLE
from ecu.errors import UserError
from ecu.settings.resources import resource

VAN = resource("config/maps/van.toml")
DATABASE = cantools.database.load_file(resource("dbc/cars/j1939.dbc"))
MS = 1_000_000
Frames = Callable[..., RecordArray]

# identifier on the bus, message, its signals -> inputs
HEARD = {
    "HRW": (
        0x0CFE6E0B,
        {
            "FrontAxleLeftWheelSpeed": 36.0,
            "FrontAxleRightWheelSpeed": 72.0,
            "RearAxle1LeftWheelSpeed": 36.0,
            "RearAxle1RightWheelSpeed": 36.0,
        },
        {"wheel_speed_fl": 10.0 / 0.337, "wheel_speed_fr": 20.0 / 0.337, "wheel_speed_rr": 10.0 / 0.337},
    ),
    "VDC2": (
        0x18F0090B,
        {
            "SteeringWheelAngle": 1.6,
            "YawRate": 0.25,
            "LateralAcceleration": 2.0,
            "LongitudinalAcceleration": -3.0,
        },
        {"steering_angle": 0.1, "yaw_rate": 0.25, "accel_y": 2.0, "accel_x": -3.0},
    ),
    "EBC1": (
        0x18F0010B,
        {"ABSActive": 1, "EBSBrakeSwitch": 1, "BrakePedalPosition": 40.0},
        {"abs_active": 1.0, "pedal_pressed": 1.0, "pedal_position": 40.0},
    ),
    "EEC2": (0x0CF00300, {"AcceleratorPedalPosition1": 20.0}, {"accelerator_position": 20.0}),
    "AMB": (0x18FEF521, {"AmbientAirTemperature": 25.0}, {"ambient_temperature": 25.0}),
}


@pytest.fixture(scope="module")
def van() -> MappedBus:
    return load_signal_map(VAN)


def hear(mapped: MappedBus, frames: RecordArray) -> np.void:
    """Return `INPUTS` after these frames."""
    inputs, reception = np.zeros(1, INPUTS), new_reception(mapped.plan)
    begin_cycle(inputs[0], int(frames["stamp_ns"].max()), 10 * MS)
    receive(mapped.plan, reception, frames, 0, len(frames), inputs[0])
    end_cycle(inputs[0], reception.freshness)
    return inputs[0]


@pytest.mark.parametrize("name", HEARD)
def test_a_parameter_group_is_heard_from_its_sender_alone(van: MappedBus, name: str, frame: Frames) -> None:
    can_id, sent, expected = HEARD[name]
    data = DATABASE.encode_message(name, sent, strict=False, padding=False)
    heard = hear(van, frame(0, can_id, data, FRAME_EXTENDED))
    for target, value in expected.items():
        assert heard["verdict"][INPUT[target]] & USABLE == USABLE
        assert heard["value"][INPUT[target]] == pytest.approx(value, abs=1e-3)
    for other in (can_id ^ 0x01, can_id ^ 0x100):  # source, parameter group
        assert not hear(van, frame(0, other, data, FRAME_EXTENDED))["new"].any()
    assert not hear(van, frame(0, can_id & 0x7FF, data, 0))["new"].any()  # 11 bits
    for priority in range(8):
        found = hear(van, frame(0, can_id & 0x3FFFFFF | priority << 26, data, FRAME_EXTENDED))
        assert found["new"].any() == (name == "HRW" or priority == can_id >> 26), priority


def test_the_filter_lets_each_priority_through_where_any_counts(van: MappedBus) -> None:
    accepted = accepted_ids(van.plan.messages)
    heard = {can_id | EXTENDED_ID: name for name, (can_id, _, _) in HEARD.items() if name != "HRW"}
    wheels = {0xFE6E0B | priority << 26 | EXTENDED_ID: "HRW" for priority in range(8)}
    assert accepted == heard | wheels


# of 2 bits 11 and 10, of 8 bits FF and FE, of 16 bits FFxx and FExx
UNKNOWN = {
    "HRW": ("FFFFFFFFFFFFFFFF", "FFFEFFFE00FE00FE"),
    "VDC2": ("FFFFFFFFFFFFFFFF", "FFFEFFFFFEFFFEFE"),
    "EBC1": ("FFFFFFFFFFFFFFFF", "AAFEFFFFFFFFFFFF"),
    "EEC2": ("FFFFFFFFFFFFFFFF", "FFFEFFFFFFFFFFFF"),
    "AMB": ("FFFFFFFFFFFFFFFF", "FFFFFFFFFEFFFFFF"),
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_is_not_available_or_an_error_is_no_value(van: MappedBus, name: str, frame: Frames) -> None:
    for data in UNKNOWN[name]:
        heard = hear(van, frame(0, HEARD[name][0], bytes.fromhex(data), FRAME_EXTENDED))
        for target in HEARD[name][2]:
            assert heard["verdict"][INPUT[target]] & USABLE != USABLE, (target, data)


# External brake request: m/s² of the pedal, whether it counts -> bytes 1 to 3, by hand:
# raw = (15.687 − 3) · 2048 = 25983 = 657F; control mode 2, priority 1, reserved bits 1: 1110 0100
REQUESTS = [
    (3.0, True, bytes.fromhex("7F65E4")),
    (3.0, False, bytes.fromhex("7F7DC4")),
    (0.0, True, bytes.fromhex("7F7DE4")),
]


def sent_by(van: MappedBus, decel: float, valid: bool, cycles: int) -> RecordArray:
    """Return the frames of some cycles, stamped."""
    plan = transmit_plan(VAN, van.plan)
    values, state, buffer = np.zeros(N_OUTPUTS), new_transmission(plan), frame_buffer(plan)
    values[OUTPUT["decel_demand_total"]], values[OUTPUT["pressure_demand_valid"]] = decel, valid
    frames = []
    for cycle in range(cycles):
        count = transmit(plan, state, values, cycle, buffer)
        buffer["stamp_ns"] = cycle * 10 * MS
        frames.append(buffer[:count].copy())
    return np.concatenate(frames)


@pytest.mark.parametrize(("decel", "valid", "expected"), REQUESTS)
def test_the_brake_request_is_what_the_standard_says(
    van: MappedBus, decel: float, valid: bool, expected: bytes
) -> None:
    frames = sent_by(van, decel, valid, 40)
    assert len(frames) == 20  # every 20 ms
    assert set(frames["can_id"].tolist()) == {0x0C040B2A}
    assert (frames["flags"] & FRAME_EXTENDED).all()
    for place, data in enumerate(frames["data"][:, :8]):
        assert data[:7].tobytes() == expected + b"\xff" * 4
        counter = place % 16
        total = sum(data[:7].tolist()) + sum((0x0C, 0x04, 0x0B, 0x2A)) + counter
        assert int(data[7]) == ((total >> 4) + total & 0xF) << 4 | counter
    decoded = DATABASE.decode_message("XBR", frames["data"][0, :8].tobytes())
    assert decoded["ExternalAccelerationDemand"] == pytest.approx(-decel if valid else 0.0, abs=2.5e-4)


OTHER_END = f"""
database = "{resource("dbc/cars/j1939.dbc")}"
[messages.XBR]
source = 0x2A
checksum = "j1939"
counter = {{ signal = "XBRMessageCounter" }}
[inputs.decel_demand]
message = "XBR"
signal = "ExternalAccelerationDemand"
factor = -1
validity = {{ signal = "XBRControlMode", values = [2] }}
[inputs.decel_demand_valid]
message = "XBR"
signal = "XBRControlMode"
factor = 0.5
unit = "-"
"""


@pytest.mark.parametrize(("valid", "usable"), [(True, True), (False, False)])
def test_a_request_that_leaves_is_what_arrives_at_the_other_end(
    van: MappedBus, tmp_path: Path, valid: bool, usable: bool
) -> None:
    (tmp_path / "brakes.toml").write_text(OTHER_END)
    other, frames = load_signal_map(tmp_path / "brakes.toml"), sent_by(van, 3.0, valid, 60)
    heard = hear(other, frames)
    assert (heard["verdict"][INPUT["decel_demand"]] & USABLE == USABLE) == usable
    assert heard["value"][INPUT["decel_demand_valid"]] == valid
    if usable:
        assert heard["value"][INPUT["decel_demand"]] == pytest.approx(3.0, abs=2.5e-4)


TWO_OF_A_GROUP = """VERSION ""
BU_: X Y
BO_ 2566844427 Fast: 8 X
 SG_ a : 0|16@1+ (0.01,0) [0|0] "m/s^2" Y
BO_ 2365517835 Slow: 8 X
 SG_ a : 0|16@1+ (0.01,0) [0|0] "m/s^2" Y
"""


@pytest.mark.parametrize(("priority", "refused"), [("6", False), ('"any"', True), ("3", True)])
def test_two_messages_that_one_frame_could_be_are_refused(
    tmp_path: Path, priority: str, refused: bool
) -> None:
    (tmp_path / "two.dbc").write_text(TWO_OF_A_GROUP)
    (tmp_path / "car.toml").write_text(
        f"""database = "two.dbc"
[messages]
Fast = {{ period = 0.01, priority = {priority} }}
Slow = {{ period = 0.1 }}
[inputs]
accel_x = {{ message = "Fast", signal = "a" }}
accel_y = {{ message = "Slow", signal = "a" }}
"""
    )
    if not refused:
        assert len(load_signal_map(tmp_path / "car.toml").plan.ids) == 2
        return
    with pytest.raises(UserError, match="has the identifier CFEF00B too; give each its own"):
        load_signal_map(tmp_path / "car.toml")


@pytest.mark.parametrize(
    ("car", "old", "new", "message"),
    [
        ("van", "[messages.EBC1]\nsource = 0x0B", "", "messages.EBC1.source: missing, and the data"),
        ("van", "source = 0x21", "source = 254", "messages.AMB.source: give a value of at most 253"),
        ("van", "source = 0x2A", "", "messages.XBR.source: missing"),
        ("van", "source = 0x2A", 'source = 0x2A\npriority = "any"', "a message that is sent has one; give a"),
        ("van", 'priority = "any"', 'priority = "some"', "messages.HRW.priority"),
        ("mustang", "[messages.WheelSpeed]", "[messages.WheelSpeed]\nsource = 11", "source and priority are"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(tmp_path: Path, car: str, old: str, new: str, message: str) -> None:
    text = resource(f"config/maps/{car}.toml").read_text("utf-8")
    assert old in text
    text = text.replace(old, new).replace("../../dbc/cars", str(resource("dbc/cars/j1939.dbc").parent))
    (tmp_path / "car.toml").write_text(text)
    with pytest.raises(UserError) as caught:
        transmit_plan(tmp_path / "car.toml", load_signal_map(tmp_path / "car.toml").plan)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
