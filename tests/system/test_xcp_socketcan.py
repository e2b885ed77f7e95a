"""`run --xcp` on SocketCAN: the kernel filters and hands on, the master is one of our own."""

import time

import pytest

from brakelab.bench.xcp_master import VARIABLES, CanWire, Master
from ecu.bus.channel import open_bus
from ecu.recording.recorder import read_recording

from .conftest import ROOT, driven
from .test_xcp_calibration import SECRET, same_bits

pytestmark = pytest.mark.socketcan

BUS = ("--config", ROOT / "config" / "suv.toml", "-i", "socketcan", "-c", "vcan0")


def test_the_kernel_of_the_loop_goes_by_a_calibration_and_the_replay_gives_the_same_bits(
    daemon, vehicle, tmp_path
):
    key = tmp_path / "key"
    key.write_text(SECRET.hex())
    key.chmod(0o600)
    one = daemon(*BUS, "--xcp", "can:0x7A0:0x7A8", "--xcp-key", key, "--record", tmp_path / "record")
    one.wait_for("ready")
    car = vehicle("socketcan", "vcan0")
    car.set(pedal_position=40, pedal_pressed=1, vehicle_speed=20, vehicle_speed_valid=1)
    car.set(**{f"wheel_speed_{corner}": 55.0 for corner in ("fl", "fr", "rl", "rr")})
    with driven(car):
        master = Master(CanWire(open_bus("socketcan", "vcan0"), 0x7A0, 0x7A8)).connect()
        master.unlock(SECRET, most=6)
        decels = [0.0, 0.0, 0.8, 1.9, 4.0, 6.6, 10.0]
        master.download("parameters.control.pedal_decel", *decels, most=6)
        master.take_over()
        one.wait_for("calibrated", number=1)
        time.sleep(1.0)
        master.close()
    assert one.end() == 0
    recorded = read_recording(tmp_path / "record")
    (note,) = recorded.calibrations
    asked = recorded.outputs["decel_demand_total"]
    assert (asked[note.cycle - 1], asked[note.cycle]) == (2.1, 1.9)
    assert same_bits(recorded.folder, tmp_path / "result.parquet") == []


def test_a_master_measures_on_the_bus_of_the_run(daemon, vehicle):
    one = daemon(*BUS, "--xcp", "can:0x7A0:0x7A8")
    one.wait_for("ready")
    address, _ = VARIABLES["outputs.mode"]
    with driven(vehicle("socketcan", "vcan0")):
        master = Master(CanWire(open_bus("socketcan", "vcan0"), 0x7A0, 0x7A8)).connect()
        master.begin([[(address, 3)], [(address + 3, 5)]])
        while len(master.packets) < 50:
            master.take()
        master.close()
        assert [packet[0] for packet in master.packets] == [0, 1] * 25
    assert one.end() == 0
