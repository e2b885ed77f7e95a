"""Lines of the log: faults in the names of the bus that the daemon is on, and slow stages."""

from pathlib import Path

import pytest
from structlog.testing import capture_logs

from ecu.bus.receive_plan import messages_by_contract
from ecu.bus.signal_map import load_signal_map
from ecu.contract.faults import FAULTS
from ecu.contract.records import STAGE_SHARES_NS, STAGES, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.recording.events import EventLog, in_names_of
from ecu.recording.ring import RECORDED

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


def slow_lines(stage_ns: list[list[int]]) -> list[str]:
    records = new_record(RECORDED, len(stage_ns))
    records["cycle"]["number"], records["cycle"]["stage_ns"] = range(len(stage_ns)), stage_ns
    with capture_logs() as lines:
        EventLog().look(records, 0, 0)
    return [
        "{log_level}: {stage} {took_ms} of {share_ms} in {cycles}, {cycle}".format(**one)
        for one in lines
        if one["event"] == "slow"
    ]


def test_a_stage_that_takes_more_than_its_share_is_named_with_its_worst_cycle() -> None:
    usual = [300_000, 30_000, 20_000, 12_000, 90_000]
    slow = [16_351_600, 30_000, 20_000, 1_000_001, 90_000]
    assert slow_lines([usual, [*STAGE_SHARES_NS]]) == []
    assert slow_lines([usual, [2_500_000, *usual[1:]], slow, usual]) == [
        "warning: drain 16.3516 of 2.0 in 2, 2",
        "warning: transmit 1.000001 of 1.0 in 1, 2",
    ]


def test_the_shares_of_all_stages_leave_a_tenth_of_a_cycle() -> None:
    assert len(STAGE_SHARES_NS) == len(STAGES)
    assert sum(STAGE_SHARES_NS) == 0.9 * CYCLE_NS
