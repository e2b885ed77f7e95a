"""`run --diagnostics` on a real bus, asked by foreign testers (udsoncan): one, two, dead and hostile ones."""

import io
import json
import os
import random
import re
import signal
import socket
import struct
import threading
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import can
import pytest
from udsoncan.exceptions import (
    InvalidResponseException,
    NegativeResponseException,
    TimeoutException,
    UnexpectedResponseException,
)

from brakelab.testing.daemon import patience, wait_for
from ecu import __version__
from ecu.cli import main
from ecu.contract.faults import WHEEL_SPEED_LOST
from ecu.diagnostics.identifiers import MEASURED, OF_SNAPSHOT, has_corners
from ecu.diagnostics.services import SELF_TEST
from ecu.diagnostics.trouble_codes import TROUBLE_CODES

from . import uds_tester
from .conftest import ROOT, driven, process_of, unharmed
from .uds_tester import asked

pytestmark = pytest.mark.multicast

GROUP = f"239.81.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
WHEEL_SPEED = next(code.number for code in TROUBLE_CODES if code.fault.bit == WHEEL_SPEED_LOST)


def foreign_tester(addresses=(0x7E0, 0x7E8), **config):
    """A tester on the bus of this module."""
    return uds_tester.foreign_tester(addresses, interface="udp_multicast", channel=GROUP, **config)


def server_of(unit):
    """Process of the diagnostic server, None: it is away."""
    return process_of(unit, "ecu.diagnostics.process")


@pytest.mark.study
def test_a_foreign_tester_reads_clears_tests_and_gets_access(unit, tmp_path):
    with foreign_tester() as client:
        asked(client, lambda one: one.tester_present())
        assert client.read_data_by_identifier_first([0xF189]) == __version__
        assert client.read_data_by_identifier_first([0xF1A1]) == "suv"
        values = client.read_data_by_identifier([one.number for one in MEASURED]).service_data.values
        named = {one.name: values[one.number] for one in MEASURED}
        assert named["calliper_pressure"] == pytest.approx([0.0] * 4, abs=0.01)
        assert named["speaks"] == [1]
        assert all(len(named[one.name]) == (4 if has_corners(one) else 1) for one in MEASURED)
        supported = client.get_supported_dtc().service_data
        assert supported.dtc_count == len(TROUBLE_CODES)
        assert supported.status_availability.get_byte_as_int() == 0x7F
        session = client.change_session(3).service_data
        assert (session.p2_server_max, session.p2_star_server_max) == (0.05, 5.0)
        with pytest.raises(NegativeResponseException, match="SecurityAccessDenied"):
            client.start_routine(0x0201)
        client.unlock_security_access(1)
        with pytest.raises(NegativeResponseException, match="ConditionsNotCorrect"):  # it drives
            client.start_routine(0x0201, b"\x03")
        with pytest.raises(NegativeResponseException, match="ConditionsNotCorrect"):
            client.ecu_reset(1)
        assert client.start_routine(SELF_TEST).service_data.routine_status_record[0] == 0
        client.control_dtc_setting(2)
        client.clear_dtc()
        assert client.get_number_of_dtc_by_status_mask(0x08).service_data.dtc_count == 0
    unharmed(unit, tmp_path / "record")


def test_a_fault_is_confirmed_kept_and_read_with_its_snapshot(daemon, car, tmp_path):
    bus = ("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP)
    keeps = ("--state", tmp_path / "state", "--diagnostics", "0x18DA28F1:0x18DAF128")
    first = daemon(*bus, *keeps)
    first.wait_for("ready")
    with foreign_tester((0x18DA28F1, 0x18DAF128)) as client:
        with driven(car):
            asked(client, lambda one: one.tester_present())

            def is_driven():
                return client.get_number_of_dtc_by_status_mask(0x01).service_data.dtc_count == 0

            wait_for(is_driven)
            client.clear_dtc()
        first.wait_for("fault", fault="wheel speed lost")

        def is_confirmed():
            return WHEEL_SPEED in [dtc.id for dtc in client.get_dtc_by_status_mask(0x08).service_data.dtcs]

        wait_for(is_confirmed)
        found = client.get_dtc_snapshot_by_dtc_number(WHEEL_SPEED, 1).service_data.dtcs[0]
        values = {one.did: one.data for one in found.snapshots}
        assert list(values) == [one.number for one in OF_SNAPSHOT]
        assert values[0x0103] == pytest.approx([20.0], abs=1.0)
        more = client.get_dtc_extended_data_by_dtc_number(WHEEL_SPEED, 1).service_data.dtcs[0]
        assert more.extended_data[0].raw_data == b"\x01"
        assert first.end() == 0
        second = daemon(*bus, *keeps)
        second.wait_for("ready")
        listed = asked(client, lambda one: one.get_dtc_by_status_mask(0x08)).service_data.dtcs
        assert WHEEL_SPEED in [dtc.id for dtc in listed]
        second.end()


@pytest.mark.study
def test_two_testers_at_once(unit, tmp_path):
    """They have one pair of identifiers: each hears the other's answers too, and asks again."""
    wanted = {
        0x1: lambda one: one.read_data_by_identifier_first([0x0103]),
        0x2: lambda one: one.get_supported_dtc().service_data.dtc_count,
    }
    counts = dict.fromkeys(wanted, 0)

    def ask_for(which):
        with foreign_tester(request_timeout=2, p2_timeout=2) as client:
            asked(client, lambda one: one.tester_present())
            end_s = time.monotonic() + 2
            while time.monotonic() < end_s or counts[which] < 20:
                try:
                    wanted[which](client)
                    counts[which] += 1
                except (TimeoutException, UnexpectedResponseException, InvalidResponseException):
                    continue

    threads = [threading.Thread(target=ask_for, args=[which]) for which in wanted]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    assert min(counts.values()) >= 20, counts
    unharmed(unit, tmp_path / "record")


@pytest.mark.study
def test_a_tester_that_dies_in_the_middle_of_a_message(unit, tmp_path):
    """In a request after its first frame, in a response before its flow control; then another one asks."""
    with foreign_tester() as client:
        asked(client, lambda one: one.tester_present())
        for data in (b"\x10\x20\x22\x01\x03\x01\x03\x01", b"\x02\x19\x0a\xcc\xcc\xcc\xcc\xcc"):
            client.bus.send(can.Message(arbitration_id=0x7E0, is_extended_id=False, data=data))
        assert client.get_supported_dtc().service_data.dtc_count == len(TROUBLE_CODES)
    unharmed(unit, tmp_path / "record")


@pytest.mark.study
def test_fuzzed_frames_and_requests(unit, tmp_path):
    draw = random.Random(20)
    with foreign_tester() as client:
        asked(client, lambda one: one.tester_present())
        before = server_of(unit)
        for number in range(3000):
            data = draw.randbytes(draw.randint(0, 8))
            if number % 3 == 0:  # a whole request
                service = draw.choice([0x10, 0x11, 0x14, 0x19, 0x22, 0x27, 0x28, 0x2E, 0x31, 0x3E, 0x85])
                data = bytes([draw.randint(1, 6), service]) + draw.randbytes(6)
            address = draw.choice([0x7E0, 0x7DF])
            client.bus.send(can.Message(arbitration_id=address, is_extended_id=False, data=data))
            time.sleep(0.0005)
        time.sleep(1.2)  # a message that somebody began is given up
        client.conn.empty_rxqueue()
        asked(client, lambda one: one.change_session(1))
        assert asked(client, lambda one: one.read_data_by_identifier_first([0xF189])) == __version__
        assert server_of(unit) == before
    unharmed(unit, tmp_path / "record")


@pytest.mark.requirement("REQ-PROC-4")
def test_loop_and_recorder_do_not_care_for_the_server(unit, tmp_path):
    with foreign_tester(request_timeout=1, p2_timeout=1) as client:
        asked(client, lambda one: one.tester_present())
        first = server_of(unit)
        for number in (signal.SIGTERM, signal.SIGINT):  # a group's are left to the loop
            os.kill(first, number)
        assert asked(client, lambda one: one.tester_present())
        os.kill(first, signal.SIGKILL)
        assert asked(client, lambda one: one.tester_present())
        last = server_of(unit)
        assert last not in (None, first)
    unharmed(unit, tmp_path / "record")
    wait_for(lambda: not Path(f"/proc/{last}").exists())


@pytest.mark.requirement("REQ-PROC-5")
def test_it_does_not_listen_unless_asked(daemon, car):
    one = daemon("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP)
    one.wait_for("ready")
    with driven(car), foreign_tester() as client:
        with pytest.raises(TimeoutException):
            client.tester_present()
        assert server_of(one) is None
    assert one.end() == 0


def diag(*words):
    """Run `brake-ecu diag`; return its exit code, output and errors."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as error:
        code = main(["diag", *words, "-i", "udp_multicast", "-c", GROUP])
    return code, out.getvalue(), error.getvalue()


def answered(*words):
    """Run it until the unit answers within its second: beside other tests it may be late."""
    for _ in patience():
        code, out, error = diag(*words)
        if "no answer within" not in out + error:
            return code, out, error
    raise AssertionError


def test_the_small_tester(unit, tmp_path):
    with foreign_tester() as client:
        asked(client, lambda one: one.tester_present())
    assert answered("clear") == (0, "cleared: all\n", "")
    code, out, _ = answered("faults", "--json")
    assert code == (1 if json.loads(out)["faults"] else 0)
    assert answered("info")[1].splitlines()[0] == f"software {__version__}"
    code, out, _ = answered("read", "speaks", "0x0113")
    assert code == 0
    assert re.fullmatch(r"speaks 1\npressure_demand [\d.]+/[\d.]+/[\d.]+/[\d.]+ bar\n", out)
    code, _, error = answered("read", "0x9999")
    assert (code, error) == (1, "brake-ecu: service 0x22 refused: requestOutOfRange\n")
    code, _, error = diag("info", "--ids", "0x7E1:0x7E9")
    assert code == 1
    assert error.startswith("brake-ecu: no answer within 1 s on 0x7E9 to a request on 0x7E1")
    unharmed(unit, tmp_path / "record")


@pytest.mark.study
def test_a_reset_restarts_a_shadow_by_its_service_manager(daemon, car, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        bus = ("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP)
        one = daemon(*bus, "--diagnostics", "7E0:7E8", NOTIFY_SOCKET=str(tmp_path / "notify"))
        one.wait_for("ready")
        with driven(car), foreign_tester() as client:
            asked(client, lambda one: one.tester_present())
            client.ecu_reset(1)
            assert one.process.wait(60) == 0
        assert one.end(None) == 0
        assert one.wait_for("stopped")["by"] == "SIGTERM"


@pytest.mark.study
def test_garbage_on_the_multicast_port_does_not_end_it(unit, tmp_path):
    with foreign_tester() as client:
        asked(client, lambda one: one.tester_present())
        before = server_of(unit)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        attacker.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, struct.pack("b", 0))
        for junk in (b"\xc1", b"no msgpack", b"") * 100:
            attacker.sendto(junk, (GROUP, 43113))
    with foreign_tester() as client:
        assert asked(client, lambda one: one.tester_present())
        assert server_of(unit) == before
    unharmed(unit, tmp_path / "record")
