"""`run --metrics-port` on a real bus: what a scraper gets, and what a crash or hanging clients cost."""

import http.client
import os
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from brakelab.testing.daemon import wait_for
from ecu.recording.recorder import read_recording

from .conftest import ROOT, free_port, process_of, unharmed

pytestmark = pytest.mark.multicast

GROUP = f"239.78.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"


def ask(port, path):
    """Return status and text, 0 while nobody answers."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    with suppress(OSError):
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    return 0, ""


def server_of(unit):
    return process_of(unit, "ecu.watch.metrics_process")


@pytest.mark.requirement("REQ-PROC-4")
def test_loop_and_recorder_do_not_care_for_the_metrics(daemon, vehicle, tmp_path):
    port = free_port()
    config = ROOT / "config" / "suv.toml"
    bus = ("--config", config, "-i", "udp_multicast", "-c", GROUP)
    one = daemon(*bus, "--record", tmp_path, "--metrics-port", port)
    one.wait_for("ready")
    car = vehicle("udp_multicast", GROUP)
    wait_for(lambda: car.drive(20).size > 0 and ask(port, "/health")[0] == 200)
    text = ask(port, "/metrics")[1]
    assert 'brake_ecu_frames_received_total{message="Imu"}' in text
    assert 'car="suv"' in text
    hanging = [socket.create_connection(("127.0.0.1", port)) for _ in range(30)]
    first = server_of(one)
    os.kill(first, signal.SIGKILL)
    for number in (signal.SIGTERM, signal.SIGINT):  # a group's are left to the loop
        with suppress(OSError):
            os.kill(server_of(one) or first, number)
    wait_for(lambda: car.drive(20).size > 0 and ask(port, "/health")[0] == 200)
    last = server_of(one)
    assert last not in (None, first)
    unharmed(one, tmp_path)
    wait_for(lambda: not Path(f"/proc/{last}").exists())
    assert one.wait_for("stopped")["cycles"] == len(read_recording(tmp_path).cycles)
    for client in hanging:
        client.close()


def test_without_prometheus_client_it_is_one_line(daemon):
    hide = "import sys; sys.modules['prometheus_client'] = None; sys.argv[0] = 'brake-ecu'\n"
    program = hide + "from ecu.cli import main; raise SystemExit(main())"
    one = daemon("--config", "suv", "-i", "virtual", "-c", "x", "--metrics-port", "9476", program=program)
    assert one.end(None) == 2
    install = f"{sys.executable} -m pip install prometheus-client"
    assert one.other == [f"brake-ecu: --metrics-port: needs prometheus-client: {install}"]


def test_an_address_that_is_none(daemon):
    place = ("--metrics-port", "9476", "--metrics-address", "every")
    one = daemon("--config", "suv", "-i", "virtual", "-c", "x", *place)
    assert one.end(None) == 2
    assert one.other == ["brake-ecu: --metrics-address: every: give an IPv4 address, 127.0.0.1 or 0.0.0.0"]
