"""What leaves a daemon: another car's messages by a map, or nothing at all."""

import os
import time
from itertools import pairwise

import cantools
import pytest

from ecu.bus.channel import open_channel
from ecu.contract.records import EXTENDED_ID, FRAME, new_record
from ecu.contract.signals import INPUT_SIGNALS

from .conftest import DBC, ROOT, demand_ids

pytestmark = pytest.mark.multicast

GROUP = f"239.82.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
BUS = ("-i", "udp_multicast", "-c", GROUP)
UNIT = """VERSION ""
BU_: Ecu Unit
BO_ 288 Pressures: 12 Ecu
 SG_ checksum : 7|8@0+ (1,0) [0|0] "" Unit
 SG_ count : 11|4@0+ (1,0) [0|0] "" Unit
 SG_ valid : 15|2@0+ (1,0) [0|0] "" Unit
 SG_ fl : 23|16@0+ (1,0) [0|0] "kPa" Unit
 SG_ fr : 39|16@0+ (1,0) [0|0] "kPa" Unit
BO_ 2566844926 Torques: 8 Ecu
 SG_ rl : 0|16@1- (0.5,0) [0|0] "Nm" Unit
 SG_ rr : 16|16@1- (0.5,0) [0|0] "Nm" Unit
 SG_ sum : 56|8@1+ (1,0) [0|0] "" Unit
"""
TORQUES = 0x18FEF1FE
OUTPUTS = """
[messages.Pressures]
period = 0.01
checksum = "autosar_p01"
data_id = 0x120
counter = { signal = "count" }
[messages.Torques]
period = 0.02
checksum = "hyundai_sum"
[outputs]
torque_demand_rl = { message = "Torques", signal = "rl", invalid = -1 }
torque_demand_rr = { message = "Torques", signal = "rr", invalid = -1 }
[outputs.pressure_demand_fl]
message = "Pressures"
signal = "fl"
validity = { signal = "valid", valid = 1, invalid = 2 }
[outputs.pressure_demand_fr]
message = "Pressures"
signal = "fr"
validity = { signal = "valid", valid = 1, invalid = 2 }
"""


@pytest.fixture
def unit_map(tmp_path):
    """A map that takes the contract's inputs and sends to a unit of another maker."""
    inputs = [one for one in INPUT_SIGNALS if one.message]
    lines = [f'{one.name} = {{ message = "{one.message}", signal = "{one.name}" }}' for one in inputs]
    (tmp_path / "unit.dbc").write_text(UNIT)
    head = f'database = "{DBC}"\noutput_database = "unit.dbc"\n[inputs]\n'
    (tmp_path / "map.toml").write_text(head + "\n".join(lines) + OUTPUTS)
    (tmp_path / "car.toml").write_text(f'include = "{ROOT / "config" / "suv.toml"}"\ncan_fd = true\n')
    return tmp_path / "map.toml"


@pytest.mark.requirement("REQ-DEM-7")
def test_an_armed_run_demands_in_another_makers_messages_and_takes_it_back(daemon, car, unit_map):
    hears = open_channel(
        "udp_multicast", GROUP, receive_ids=[288, TORQUES | EXTENDED_ID, *demand_ids()], fd=True
    )
    unit = daemon("--config", unit_map.parent / "car.toml", "--map", unit_map, "--armed", *BUS)
    unit.wait_for("ready")
    frames, database, heard = (
        new_record(FRAME, 4096),
        cantools.database.load_string(UNIT),
        {288: [], TORQUES: []},
    )

    def listen():
        for frame in frames[: hears.drain(frames, 0)]:
            payload = frame["data"][: frame["length"]].tobytes()
            heard[int(frame["can_id"])].append(database.decode_message(int(frame["can_id"]), payload))
        return bool(heard[TORQUES]) and heard[288][-1]["valid"] == 1 and heard[TORQUES][-1]["rl"] > 100.0

    car.drive(0, until=listen)
    time.sleep(0.02)
    listen()
    pressures, torques = heard[288][-1], heard[TORQUES][-1]
    assert pressures["fl"] == pressures["fr"] > 500.0  # kPa, at 3 m/s²
    assert torques["rl"] == torques["rr"]
    counts = [one["count"] for one in heard[288]]
    assert all((after - before) % 15 <= 2 for before, after in pairwise(counts))
    assert unit.end() == 0
    listen()
    assert (heard[288][-1]["valid"], heard[288][-1]["fl"], heard[TORQUES][-1]["rl"]) == (2, 0, -1)
    hears.close()


@pytest.mark.requirement("REQ-DEM-8")
def test_a_silent_run_estimates_and_sends_nothing(daemon, car):
    unit = daemon("--config", ROOT / "config" / "suv.toml", "--silent", *BUS)
    ready = unit.wait_for("ready")
    assert (ready["silent"], ready["armed"]) == (True, False)
    car.drive(0, until=lambda: unit.said("mode", now="active"))
    assert not len(car.hear())
    assert unit.end() == 0
    assert not len(car.hear())
    assert unit.wait_for("stopped")["cycles"] > 0
