"""Lines of the log on faults, in the names of the bus that the daemon is on."""

from pathlib import Path

import pytest

from ecu.bus.receive_plan import messages_by_contract
from ecu.bus.signal_map import load_signal_map
from ecu.contract.faults import FAULTS
from ecu.recording.events import in_names_of

MUSTANG = Path(__file__).parents[3] / "config" / "maps" / "mustang.toml"


@pytest.mark.parametrize(
    ("messages", "remedy", "said"),
    [
        ({}, "check CalliperPressure*", "check CalliperPressure*"),
        ({"CalliperPressure": ["PRESS"]}, "check CalliperPressure*", "check PRESS"),
        ({"Imu": ["YAW", "ACC"]}, "check Steering, Imu", "check Steering, YAW, ACC"),
        ({"Imu": ["VDC2"], "Steering": ["VDC2"]}, "check Steering, Imu", "check VDC2"),
        ({"Motor": ["INV_1"]}, "check the sender of Motor*", "check the sender of INV_1"),
        ({"Motor": ["INV_1"]}, "the receiver of MotorDemand*", "the receiver of MotorDemand*"),
    ],
)
def test_a_remedy_names_the_messages_of_the_bus(
    messages: dict[str, list[str]], remedy: str, said: str
) -> None:
    assert in_names_of(messages, remedy) == said


def test_a_map_s_messages_stand_for_those_of_the_contract() -> None:
    mapped = load_signal_map(MUSTANG)
    messages = messages_by_contract(mapped.plan)
    assert set().union(*messages.values()) == set(mapped.plan.messages["name"].tolist())
    said = [in_names_of(messages, fault.remedy) for fault in FAULTS]
    assert not any(f" {name}*" in line for name in messages for line in said)
