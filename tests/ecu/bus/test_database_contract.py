"""dbc/brake_ecu.dbc against the table of signals and the contract's scaling rules."""

from pathlib import Path
from typing import Any

import pytest
from cantools.database import Message

from ecu.bus.database import attribute, load_database
from ecu.bus.plan import not_available_code
from ecu.contract.signals import INPUT, INPUT_SIGNALS, OUTPUT_SIGNALS, column_names

PROTECTION = {"crc", "alive_counter"}


@pytest.fixture(scope="module")
def messages(contract: Path) -> dict[str, Message]:
    return {message.name: message for message in load_database(contract).messages}


def signal(message: Message, name: str) -> Any:
    return message.get_signal_by_name(name)


def test_every_input_is_in_its_message_with_its_unit(messages: dict[str, Message]) -> None:
    for item in INPUT_SIGNALS:
        if item.message:
            message = messages[item.message]
            found = signal(message, item.name)
            assert (found.unit, message.senders, found.receivers) == (item.unit, ["Vehicle"], ["BrakeEcu"])
            assert found.minimum <= item.low, item.name
            assert found.maximum >= item.high, item.name


def test_every_output_is_in_its_message_with_its_unit(messages: dict[str, Message]) -> None:
    for item in OUTPUT_SIGNALS:
        for name in column_names(item):
            for stem in item.message.split():
                axle = "Front" if name.endswith(("_fl", "_fr")) else "Rear"
                message = messages.get(stem) or messages[stem + axle]
                found = signal(message, name)
                assert (found.unit, message.senders) == (item.unit, ["BrakeEcu"])
                assert found.receivers == ["Vehicle"]


def test_nothing_else_is_in_the_database(messages: dict[str, Message]) -> None:
    outputs = {name for item in OUTPUT_SIGNALS for name in column_names(item)}
    for message in messages.values():
        names = {found.name for found in message.signals} - PROTECTION
        assert names <= (set(INPUT) if message.senders == ["Vehicle"] else outputs), message.name


def test_every_signal_reserves_its_last_code_for_not_available(messages: dict[str, Message]) -> None:
    for message in messages.values():
        for found in message.signals:
            if found.name in PROTECTION:
                continue
            if found.is_float:
                assert "Not available: NaN" in str(found.comment)
                continue
            code = -(1 << (found.length - 1)) if found.is_signed else (1 << found.length) - 1
            assert not_available_code(found) == code, found.name
            assert f"Not available: raw {code}" in str(found.comment)
            limits = [(float(end) - found.offset) / found.scale for end in (found.minimum, found.maximum)]
            assert not limits[0] - 0.5 <= code <= limits[1] + 0.5, found.name


@pytest.mark.parametrize(
    ("stem", "step"),
    [  # against the noise of Table 4.1: 0.1 rad/s, 0.01 m/s^2, 1.8 bar, 0.027 m/s, 10 N
        ("wheel_speed_", 0.01),
        ("accel_x", 0.002),
        ("accel_y", 0.002),
        ("yaw_rate", 0.0005),
        ("calliper_pressure_", 0.02),
        ("pressure_demand_f", 0.02),
        ("vehicle_speed", 0.005),
        ("wheel_force_x_", 5.0),
        ("steering_angle", 0.0001),
        ("decel_demand", 0.002),
        ("motor_torque_", 1.0),
        ("mu_b_", 1e-4),
        ("sigma_mu_b_", 2e-4),
        ("disc_temperature_", 0.1),
    ],
)
def test_quantisation_is_fine_against_the_noise(messages: dict[str, Message], stem: str, step: float) -> None:
    found = [s for m in messages.values() for s in m.signals if s.name.startswith(stem)]
    steps = [s.scale for s in found if not s.name.endswith("valid")]
    assert steps
    assert max(steps) <= step


def test_pressures_are_read_down_to_minus_10_bar(messages: dict[str, Message]) -> None:
    for axle in ("Front", "Rear"):
        for found in messages[f"CalliperPressure{axle}"].signals:
            if found.name not in PROTECTION:
                assert found.minimum == -10.0


def test_frames_of_10_and_20_ms_are_protected(messages: dict[str, Message]) -> None:
    data_ids = []
    for message in messages.values():
        fast = attribute(message, "GenMsgCycleTime") <= 20
        data_id = attribute(message, "E2EDataId")
        assert (data_id != 0) == fast, message.name
        if fast:
            crc, counter = signal(message, "crc"), signal(message, "alive_counter")
            assert (crc.start, crc.length, counter.start, counter.length) == (0, 8, 8, 4)
            assert message.length == 8
            data_ids.append(data_id)
    assert len(set(data_ids)) == len(data_ids)


def test_demands_win_the_arbitration(messages: dict[str, Message]) -> None:
    by_identifier = sorted(messages, key=lambda name: messages[name].frame_id)
    assert by_identifier[:4] == [
        "PressureDemandFront",
        "PressureDemandRear",
        "MotorDemandFront",
        "MotorDemandRear",
    ]


def test_slow_frames_are_spread_over_the_cycles(messages: dict[str, Message]) -> None:
    """No cycle carries more than one slow frame of a sender (beside those of 10 and 20 ms)."""
    for sender in ("BrakeEcu", "Vehicle"):
        slow = [
            [
                m.name
                for m in messages.values()
                if m.senders == [sender]
                and attribute(m, "GenMsgCycleTime") > 20
                and (10 * cycle - attribute(m, "CyclePhase")) % attribute(m, "GenMsgCycleTime") == 0
            ]
            for cycle in range(100)
        ]
        assert max(map(len, slow)) <= 1
