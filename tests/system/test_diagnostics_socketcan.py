"""`run --diagnostics` on SocketCAN, asked by a foreign tester: the kernel filters and hands on."""

import pytest

from ecu.diagnostics.trouble_codes import TROUBLE_CODES

from .conftest import ROOT, driven
from .uds_tester import asked, foreign_tester

pytestmark = pytest.mark.socketcan

BUS = ("--config", ROOT / "config" / "suv.toml", "-i", "socketcan", "-c", "vcan0")


def test_a_foreign_tester_is_answered_beside_the_loop(daemon, vehicle, tmp_path):
    """It asks again where there is no answer in time: these tests also run on an emulated machine."""
    one = daemon(*BUS, "--state", tmp_path, "--diagnostics", "0x7E0:0x7E8")
    one.wait_for("ready")
    bus = {"interface": "socketcan", "channel": "vcan0", "p2_timeout": 5}
    with driven(vehicle("socketcan", "vcan0")), foreign_tester(**bus) as client:
        found = asked(client, lambda client: client.get_supported_dtc())
        assert found.service_data.dtc_count == len(TROUBLE_CODES)
        asked(client, lambda client: client.clear_dtc())
        assert asked(client, lambda client: client.read_data_by_identifier_first([0x0123])) == [1.0]
    assert one.end() == 0
