"""The processes of an armed daemon against what happens around them: the bus is judged, not the log."""

import os
import random
import signal
import socket
import time
from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.cycle import DEMAND_TIMEOUT
from brakelab.testing.daemon import wait_for
from ecu.bus.e2e import P01_MODULO
from ecu.contract.faults import FOREIGN_SENDER, NOT_KEPT
from ecu.contract.signals import CYCLE_NS
from ecu.recording.recorder import read_recording
from ecu.recording.store import open_store
from ecu.runtime.start import signal_name

from .conftest import ROOT, demand_ids

pytestmark = pytest.mark.multicast

GROUP = f"239.76.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"


@pytest.fixture
def bus():
    """Arguments of an armed daemon."""
    return ("--config", ROOT / "config" / "suv.toml", "--armed", "-i", "udp_multicast", "-c", GROUP)


def demands(heard):
    """Return stamps, valid flags and alive counters of the front demand, as heard."""
    front = heard[heard["can_id"] == demand_ids()[0]]
    return front["stamp_ns"], front["data"][:, 1] >> 4 & 3, (front["data"][:, 1] & 0xF).astype(int)


def brakes(car):
    """Whether the ECU's demands are valid now."""
    return demands(car.drive(5))[1][-1] == 1


def drive_until_braking(car):
    while not brakes(car):
        pass


def clogged_pipe():
    """Return a pipe that is full and that nobody reads."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    for size in (4096, 1):
        try:
            while True:
                os.write(writing, b"x" * size)
        except BlockingIOError:
            pass
    os.set_blocking(writing, True)
    return reading, writing


@pytest.mark.parametrize("log", ["its reader is gone", "nobody reads it", "its disk is full"])
@pytest.mark.requirement("REQ-LOOP-5")
def test_whatever_becomes_of_the_log_the_brakes_go_on(log, daemon, car, bus):
    reading = None
    if log == "nobody reads it":
        reading, writing = clogged_pipe()
    elif log == "its disk is full":
        writing = os.open("/dev/full", os.O_WRONLY)
    else:
        gone, writing = os.pipe()
    unit = daemon(*bus, stderr=writing)
    os.close(writing)
    drive_until_braking(car)
    if log == "its reader is gone":
        os.close(gone)
    recorder = unit.family()[2]
    car.set(pedal_position=50)  # implausible beside a free pedal: something to log
    heard = car.drive(80)
    assert unit.process.poll() is None
    assert unit.family()[2] == recorder
    assert brakes(car)
    assert set(np.diff(demands(heard)[2]) % P01_MODULO) <= {0, 1}
    assert unit.process.send_signal(signal.SIGTERM) is None
    assert unit.process.wait(10) == 0
    if reading is not None:
        os.close(reading)


def test_a_standby_takes_over_though_nobody_reads_its_log(daemon, car, bus):
    first = daemon(*bus)
    first.wait_for("ready")
    drive_until_braking(car)
    reading, writing = clogged_pipe()
    second = daemon(*bus, "--standby", stderr=writing)
    os.close(writing)
    wait_for(lambda: len(second.family()) == 3 and (car.drive(5) is not None))
    before = time.monotonic()
    car.drive(0, until=lambda: any_ring_of(second) or time.monotonic() > before + 60)
    car.drive(100)
    first.process.kill()  # it may take a while to go; the car does not wait for that
    heard = car.drive(100)
    first.process.wait()
    stamps, valid, _ = demands(heard)
    assert (valid == 1).all()
    assert np.diff(stamps).max() < 40 * CYCLE_NS
    second.process.send_signal(signal.SIGTERM)
    assert second.process.wait(10) == 0
    os.close(reading)


def any_ring_of(unit):
    """Whether the daemon has come as far as its ring."""
    return any(Path("/dev/shm").glob(f"brake-ecu.*.{unit.process.pid}.ring"))


def last_flags(car, count=3):
    """Return the last valid flags heard, once nothing comes any more."""
    heard = [car.hear()]
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        heard.append(car.hear())
        time.sleep(0.01)
    return demands(np.concatenate(heard))[1][-count:].tolist()


@pytest.mark.parametrize(
    "number",
    [signal.SIGHUP, signal.SIGTERM, signal.SIGQUIT, signal.SIGALRM, signal.SIGIO, signal.SIGRTMIN + 3],
)
@pytest.mark.requirement("REQ-DEM-3")
def test_a_signal_ends_it_with_three_demands_flagged_invalid(number, daemon, car, bus):
    unit = daemon(*bus)
    unit.wait_for("ready")
    drive_until_braking(car)
    assert unit.end(number) == 0
    assert last_flags(car) == [0, 0, 0]
    assert unit.wait_for("stopped")["by"] == signal_name(number)


BROKEN = """
import itertools, sys
import ecu.runtime.{module}
count, whole = itertools.count(), ecu.runtime.{module}.{function}
def broken(*arguments):
    if next(count) == 250:
        raise {error}
    return whole(*arguments)
ecu.runtime.{module}.{function} = broken
from ecu.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ("function", "error", "said"),
    [
        ("step", "ZeroDivisionError('found')", "unexpected ZeroDivisionError: found"),
        ("transmit", "MemoryError()", "unexpected MemoryError"),
        (
            "publish",
            "OSError(28, 'No space left on device')",
            "the loop ended: [Errno 28] No space left on device",
        ),
    ],
)
@pytest.mark.requirement("REQ-DEM-3")
def test_an_exception_in_the_cycle_ends_it_with_the_farewell_too(function, error, said, daemon, car, bus):
    program = BROKEN.format(module="cycle", function=function, error=error)
    unit = daemon(*bus, program=program)
    unit.wait_for("ready")
    heard = car.drive(0, until=lambda: unit.process.poll() is not None)
    assert unit.end(None) == 1  # a service manager starts it again
    flags = demands(heard)[1]
    assert flags[-3:].tolist() == [0, 0, 0]
    assert flags[-4] == 1
    assert any(said in line for line in unit.other)
    assert said.split()[-1] in unit.wait_for("stopped")["by"]


@pytest.mark.parametrize("member", [1, 2], ids=["supervisor", "recorder"])
@pytest.mark.requirement("REQ-PROC-1")
def test_a_killed_side_process_comes_back_and_nothing_is_lost(member, daemon, car, bus, tmp_path):
    unit = daemon(*bus, "--record", tmp_path / "record", "--state", tmp_path / "state")
    unit.wait_for("ready")
    drive_until_braking(car)
    victim = unit.family()[member]
    os.kill(victim, signal.SIGKILL)
    if member == 2:
        car.drive(0, until=lambda: unit.said("fault", fault="nothing is kept"))
        car.drive(0, until=lambda: unit.said("fault_gone", fault="nothing is kept"))
        assert unit.said("recorder_gone")
    else:
        car.drive(0, until=lambda: unit.said("supervisor_gone"))
        car.drive(150)
    assert brakes(car)
    assert unit.end() == 0
    stopped, recording = unit.wait_for("stopped"), read_recording(tmp_path / "record")
    assert recording.cycles["number"].tolist() == list(range(stopped["cycles"]))
    assert len(recording.frames.read_text().splitlines()) == recording.cycles["frames"].sum()
    unkept = (recording.outputs["active_faults"].astype(int) & NOT_KEPT) > 0
    assert unkept.any() == (member == 2)
    assert not unkept[-1]


@pytest.mark.requirement("REQ-PROC-2")
def test_a_state_folder_that_cannot_be_written_is_a_line_and_a_fault_bit(daemon, car, bus, tmp_path):
    (tmp_path / "file").write_text("")
    unit = daemon(*bus, "--state", tmp_path / "file")
    unit.wait_for("ready")
    drive_until_braking(car)
    car.drive(0, until=lambda: unit.said("fault", fault="nothing is kept"))
    assert unit.end() == 0
    assert len([line for line in unit.seen if line["event"] == "not_kept"]) == 1


def heard_by(manager):
    """Return the next word, None if none comes."""
    try:
        return manager.recv(100)
    except TimeoutError:
        return None


@pytest.mark.requirement("REQ-PROC-3")
def test_the_service_manager_hears_ready_signs_of_life_and_the_end(daemon, car, bus, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(60)
        unit = daemon(*bus, NOTIFY_SOCKET=str(tmp_path / "notify"), WATCHDOG_USEC="400000")
        while (word := manager.recv(100)) != b"READY=1":
            assert word.startswith(b"STATUS=")
        car.drive(101)
        manager.setblocking(False)
        words = []
        while True:
            try:
                words.append(manager.recv(100))
            except BlockingIOError:
                break
        assert set(words) == {b"WATCHDOG=1"}
        assert len(words) >= 9  # each tenth cycle
        os.kill(unit.process.pid, signal.SIGSTOP)  # a loop that hangs gives none
        os.waitpid(unit.process.pid, os.WUNTRACED)
        manager.settimeout(0.5)
        while (word := heard_by(manager)) is not None:
            assert word == b"WATCHDOG=1"
        os.kill(unit.process.pid, signal.SIGCONT)
        assert unit.end() == 0
        manager.settimeout(10)
        while (word := manager.recv(100)) != b"STOPPING=1":
            assert word == b"WATCHDOG=1"


@pytest.mark.requirement("REQ-LOOP-6")
def test_while_it_compiles_it_says_so_and_obeys(daemon, bus, tmp_path):
    unit = daemon(*bus, NUMBA_CACHE_DIR=str(tmp_path / "cold"), BRAKE_ECU_LIBRARY="0")
    assert "ecu.warm" in unit.wait_for("compiling")["remedy"]
    began = time.monotonic()
    assert unit.end() == 0
    assert time.monotonic() - began < 15.0  # long before all is compiled; its side process ends, too
    assert not any_ring_of(unit)


@pytest.mark.requirement("REQ-IN-4")
def test_malformed_datagrams_are_no_bus_off(daemon, car, bus):
    unit = daemon(*bus)
    unit.wait_for("ready")
    drive_until_braking(car)
    heard = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        attacker.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for _ in range(100):
            for junk in (b"\xc1", b"no msgpack", b""):
                attacker.sendto(junk, (GROUP, 43113))
            heard.append(car.drive(1))
    assert (demands(np.concatenate(heard))[1] == 1).all()
    assert unit.end() == 0
    assert not any(line.get("fault") == "bus off" for line in unit.seen)


@pytest.mark.requirement("REQ-TWO-3")
def test_an_established_one_stays_beside_another_sender_and_tells_it(daemon, car, bus, tmp_path):
    unit = daemon(*bus, "--record", tmp_path)
    unit.wait_for("ready")
    car.drive(220)
    drive_until_braking(car)
    stale = car.drive(1)
    stale = stale[stale["can_id"] == demand_ids()[0]][-1:].copy()
    stale["data"][0, 2:6] = 0
    for _ in range(100):
        car.channel.send(stale, 1)
        car.drive(1)
    car.drive(20)
    assert unit.end() == 0
    outputs = read_recording(tmp_path).outputs
    assert (outputs["active_faults"].astype(int) & FOREIGN_SENDER).any()
    assert not any(line["event"] == "falls_silent" for line in unit.seen)
    assert outputs["pressure_demand_valid"][-20:].all()


@pytest.mark.requirement("REQ-TWO-5")
def test_of_two_that_begin_together_one_speaks(daemon, car, bus):
    units = [daemon(*bus) for _ in range(2)]
    silent = ("falls_silent",)
    car.drive(
        50,
        until=lambda: any(unit.process.poll() is not None or unit.said(*silent) for unit in units),
    )
    car.drive(60)
    counters = demands(car.drive(100))[2]
    assert set(np.diff(counters) % P01_MODULO) <= {0, 1}
    codes = sorted(unit.end() for unit in units)
    assert codes in ([0, 0], [0, 2])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.requirement("REQ-DEM-4")
def test_whoever_is_killed_whenever_no_dead_one_brakes_and_the_state_opens(seed, daemon, car, bus, tmp_path):
    draw = random.Random(seed)
    unit = daemon(*bus, "--state", tmp_path / "state", "--record", tmp_path / "record")
    unit.wait_for("ready")
    drive_until_braking(car)
    for member in draw.sample(range(3), 3) if seed else [1, 2, 0]:  # each of them, the loop among them
        car.drive(draw.randint(1, 60))
        family = unit.family()
        if member < len(family):
            os.kill(family[member], signal.SIGKILL)
            if member == 0:
                break
    killed_ns = time.time_ns()
    unit.process.wait()
    heard = [car.hear()]
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        heard.append(car.hear())
        time.sleep(0.01)
    stamps, valid, _ = demands(np.concatenate(heard))
    assert not (valid[stamps > killed_ns + CYCLE_NS + int(DEMAND_TIMEOUT * 1e9)] == 1).any()
    unit.end(None)  # the side processes have closed the log: they are gone
    with open_store(tmp_path / "state") as store:
        assert store.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    recording = read_recording(tmp_path / "record")
    assert (np.diff(recording.cycles["number"]) == 1).all()
    assert len(recording.frames.read_text().splitlines()) == recording.cycles["frames"].sum()
