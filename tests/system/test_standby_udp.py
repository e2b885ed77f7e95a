"""Two daemons on one bus: what is said when, and what the vehicle hears after the first one was killed."""

import os
import signal
import time

import numpy as np
import pytest

from ecu.bus.e2e import P01_MODULO
from ecu.recording.recorder import read_recording

from .conftest import ROOT, demand_ids

pytestmark = pytest.mark.multicast

CONFIG = ROOT / "config" / "suv.toml"
GROUP = f"239.75.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
BUS = ("--config", CONFIG, "-i", "udp_multicast", "-c", GROUP)


def counters(heard):
    """Return the alive counters of the front demand, in the order heard."""
    return (heard["data"][heard["can_id"] == demand_ids()[0], 1] & 0xF).astype(int)


@pytest.mark.requirement("REQ-TWO-4")
def test_a_standby_is_silent_takes_over_and_keeps_the_killed_one_away(daemon, vehicle, tmp_path):
    car = vehicle("udp_multicast", GROUP)
    first = daemon(*BUS)
    first.wait_for("ready")
    car.drive(20)
    second = daemon(*BUS, "--standby", "--record", tmp_path)
    assert second.wait_for("ready")["standby"] is True
    assert second.wait_for("learned_from_ring")["ring"] == first.wait_for("ready")["ring"]
    car.hear()
    both = counters(car.drive(50, until=lambda: second.said("mode", now="ready")))
    assert set(np.diff(both) % P01_MODULO) <= {0, 1}  # one sender; 0: a frame of the cycle before
    first.process.kill()
    after = counters(car.drive(30, until=lambda: second.said("takes_over")))
    assert set(np.diff([both[-1], *after]) % P01_MODULO) <= {0, 1}  # it goes on where the first one stopped
    assert first.end(None) == -signal.SIGKILL
    refused = daemon(*BUS)
    assert refused.end(None) == 2
    assert any("someone else already sends it" in line for line in refused.other)
    car.drive(5)
    assert not second.said("falls_silent")
    assert not second.said("fault", fault="foreign sender")
    assert second.end() == 0
    assert read_recording(tmp_path).outputs["pressure_demand_valid"].max() == 0  # nobody armed it


@pytest.mark.parametrize("cycles", [0, 50])
def test_of_a_first_one_that_was_held_up_and_its_standby_one_speaks_on(daemon, vehicle, cycles: int):
    """The first one, unless it stood still for so long that it yields before it sends."""
    car = vehicle("udp_multicast", GROUP)
    first = daemon(*BUS)
    first.wait_for("ready")
    car.drive(20)
    second = daemon(*BUS, "--standby")
    second.wait_for("ready")
    car.drive(20, until=lambda: second.said("mode", now="ready"))
    first.process.send_signal(signal.SIGSTOP)
    os.waitpid(first.process.pid, os.WUNTRACED)
    car.drive(10, until=lambda: second.said("takes_over"))
    car.drive(cycles)
    first.process.send_signal(signal.SIGCONT)
    car.drive(10, until=lambda: first.said("falls_silent") or second.said("falls_silent"))
    heard = counters(car.drive(20))
    assert not (cycles and second.said("falls_silent")), "for so long: the second one speaks on"
    assert set(np.diff(heard) % P01_MODULO) <= {0, 1, 2}  # one sender again
    assert [unit.end() for unit in (second, first)] == [0, 0]


def test_without_a_first_one_a_standby_stays_silent(daemon, vehicle):
    car = vehicle("udp_multicast", GROUP)
    unit = daemon(*BUS, "--standby")
    unit.wait_for("ready")
    end = time.monotonic() + 0.3
    car.drive(0, until=lambda: time.monotonic() > end and unit.said("mode", now="ready"))
    assert len(counters(car.hear())) == 0
    assert unit.end() == 0
