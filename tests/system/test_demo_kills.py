"""`brake-ecu demo` as a user starts it, and the death of each of its processes at a random instant."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.cycle import DEMAND_TIMEOUT
from brakelab.testing.daemon import patience, wait_for
from ecu.bus.channel import open_channel
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.recording.store import open_store

from .conftest import ENVIRONMENT, demand_ids, priority

pytestmark = pytest.mark.multicast

REQUEST_LOST_S = 0.1  # time-out of BrakeRequest
FAREWELL_S = 5.0  # a daemon that is stopped says so on the bus; a busy machine takes its time


class Witness:
    """Hears the ECU's front demand on the bus of a demo."""

    def __init__(self, demo):
        group = f"239.74.163.{demo.pid % 250 + 2}"
        self._channel = open_channel("udp_multicast", group, receive_ids=demand_ids()[:1])
        self._frames = new_record(FRAME, 4096)

    def listen(self, seconds):
        """Return stamps and valid flags of what comes in the next seconds."""
        heard, end = [], time.monotonic() + seconds
        while time.monotonic() < end:
            heard.append(self._frames[: self._channel.drain(self._frames, 0)].copy())
            time.sleep(0.005)
        frames = np.concatenate(heard)
        return frames["stamp_ns"], frames["data"][:, 1] >> 4 & 3

    def close(self):
        self._channel.close()


def children(pid):
    return [
        child
        for task in Path(f"/proc/{pid}/task").glob("*/children")
        for child in map(int, task.read_text().split())
    ]


def members(demo):
    """Return the process ids of a demo by name."""
    vehicle, loop = (
        next(pid for pid in children(demo.pid) if name in Path(f"/proc/{pid}/cmdline").read_bytes())
        for name in (b"\0vehicle\0", b"\0run\0")
    )
    (supervisor,) = children(loop)
    (recorder,) = children(supervisor)
    return {
        "demo": demo.pid,
        "vehicle": vehicle,
        "loop": loop,
        "supervisor": supervisor,
        "recorder": recorder,
    }


def runs(pid):
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def demo(tmp_path):
    with subprocess.Popen(
        [sys.executable, "-m", "ecu.cli", "demo", "--out", tmp_path],
        env=ENVIRONMENT,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        yield process
        process.kill()


@pytest.mark.parametrize(
    ("victim", "silent_after_s"),
    [
        ("demo", FAREWELL_S),
        ("vehicle", REQUEST_LOST_S + 0.05),
        ("loop", CYCLE_NS * 1e-9 + DEMAND_TIMEOUT),
        ("supervisor", None),
        ("recorder", None),
    ],
)
@pytest.mark.requirement("REQ-DEM-4")
def test_whichever_process_of_a_demo_is_killed_nothing_valid_comes_from_a_dead_one(
    victim, silent_after_s, demo, tmp_path
):
    witness, draw = Witness(demo), random.Random(victim)
    for _ in patience():
        if (witness.listen(0.1)[1] == 1).any():
            break
        assert demo.poll() is None, demo.stderr.read()
    with priority():
        witness.listen(draw.uniform(0.1, 3.0))
        family = members(demo)
        os.kill(family[victim], signal.SIGKILL)
        killed_ns = time.time_ns()
        stamps, valid = witness.listen(max(silent_after_s or 0.0, 1.0) + 1.0)
    if silent_after_s is None:
        assert (valid[stamps > killed_ns] == 1).sum() > 100
        demo.send_signal(signal.SIGKILL)
    else:
        assert not (valid[stamps > killed_ns + silent_after_s * 1e9] == 1).any()
    said = demo.communicate()[1].splitlines()
    if victim in ("vehicle", "loop"):
        assert demo.returncode == 1
        assert "ended" in said[-1]
    wait_for(lambda: not any(runs(pid) for pid in family.values()))
    assert not list(Path("/dev/shm").glob(f"brake-ecu.*.{family['loop']}.ring"))
    with open_store(tmp_path / "drive" / "state") as store:
        assert store.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    witness.close()
