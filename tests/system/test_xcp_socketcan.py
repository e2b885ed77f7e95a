"""`run --xcp` on SocketCAN: the kernel filters and hands on, the master is one of our own."""

import pytest

from ecu.bus.channel import open_bus

from .conftest import ROOT, driven
from .xcp_master import VARIABLES, CanWire, Master

pytestmark = pytest.mark.socketcan

BUS = ("--config", ROOT / "config" / "suv.toml", "-i", "socketcan", "-c", "vcan0")


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
