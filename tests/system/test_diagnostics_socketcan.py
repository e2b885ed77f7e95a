"""`run --diagnostics` on SocketCAN, asked by a foreign tester: the kernel filters and hands on."""

import pytest

from ecu.diagnostics.trouble_codes import TROUBLE_CODES

from .conftest import ROOT
from .uds_tester import asked, driven, foreign_tester

pytestmark = pytest.mark.socketcan

BUS = ("--config", ROOT / "config" / "suv.toml", "-i", "socketcan", "-c", "vcan0")


@pytest.mark.parametrize("addresses", [(0x7E0, 0x7E8), (0x18DA28F1, 0x18DAF128)])
def test_a_foreign_tester_is_answered_beside_the_loop(addresses, daemon, vehicle, tmp_path):
    one = daemon(*BUS, "--state", tmp_path, "--diagnostics", ":".join(f"{number:X}" for number in addresses))
    one.wait_for("ready")
    bus = {"interface": "socketcan", "channel": "vcan0"}
    with driven(vehicle("socketcan", "vcan0")), foreign_tester(addresses, **bus) as client:
        asked(client, lambda one: one.tester_present())
        assert client.get_supported_dtc().service_data.dtc_count == len(TROUBLE_CODES)
        client.clear_dtc()
        assert client.read_data_by_identifier_first([0x0123]) == [1.0]
    assert one.end() == 0
