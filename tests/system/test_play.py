"""`brake-ecu play` as a process on real buses, heard by a socket of its own."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from brakelab.bench.play import Listener, write_log
from brakelab.rig.live import Bus

from .conftest import ENVIRONMENT

GROUP = f"239.75.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"  # a bus of this run's own
BUSES = [
    pytest.param(Bus("udp_multicast", GROUP, ""), marks=pytest.mark.multicast, id="UDP multicast"),
    pytest.param(Bus("socketcan", "vcan0", ""), marks=pytest.mark.socketcan, id="vcan0"),
]
FRAMES = 150  # an ordinary user's receive buffer holds them


@pytest.fixture(params=BUSES)
def bus(request):
    """Where to play."""
    return request.param


@pytest.fixture
def listener(bus):
    """A socket on the bus."""
    socket = Listener(bus)
    yield socket
    socket.close()


def play(bus, log, speed):
    command = [sys.executable, "-m", "ecu.cli", "play", str(log), "-i", bus.interface, "-c", bus.channel]
    return subprocess.Popen(
        [*command, "--speed", str(speed)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    )


@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_all_frames_arrive_in_order(bus, listener, tmp_path, speed):
    log = tmp_path / "drive.log"
    write_log(log, 10_000 * np.arange(FRAMES), "can0")
    player = play(bus, log, speed)
    numbers, stamps = listener.hear(player)
    out, _ = player.communicate()
    assert player.returncode == 0
    assert numbers.tolist() == list(range(FRAMES))
    assert (np.diff(stamps) >= 0).all()
    assert out.startswith(f"{log}: {FRAMES} frames sent, late by ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_and_it_says_how_far_it_came(bus, listener, tmp_path, number):
    log = tmp_path / "drive.log"
    write_log(log, 10_000 * np.arange(100_000), "can0")
    player = play(bus, log, 1.0)
    listener.wait()
    player.send_signal(number)
    numbers, _ = listener.hear(player)
    out, err = player.communicate()
    assert player.returncode == 130
    assert numbers.tolist() == list(range(len(numbers)))
    assert out.startswith(f"{log}: interrupted: {len(numbers)} frames sent, late by ")
    assert "Traceback" not in err
