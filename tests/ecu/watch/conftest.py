"""A daemon's ring, written by the test."""

import threading
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.step import INITIAL
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import CYCLE, FRAME, INPUT_WATCH, INPUTS, LEARNED, OUTPUTS, new_record
from ecu.contract.signals import CYCLE_NS, INPUT, N_INPUTS
from ecu.recording import ring as ring_module
from ecu.recording.publish import publish
from ecu.recording.recorder import layout
from ecu.recording.ring import close_ring, create_ring
from ecu.settings.resources import resource
from ecu.watch.serve import Server

START_NS = 1_800_000_000_000_000_000
MONO_NS = 5_000_000_000_000


class Loop:
    """Publishes cycles as the loop does; `outputs` and `cycle` are set by name before."""

    def __init__(self, path: Path, **about) -> None:
        self.about = {
            "name": "suv",
            "interface": "socketcan",
            "channel": "can0",
            "start_ns": START_NS,
            "map": None,
            "state": layout(INITIAL),
            **about,
        }
        self.ring = create_ring(path, self.about, new_record(INITIAL).tobytes(), slots=2400, frames=4096)
        self.cycle, self.outputs, self.learned = new_record(CYCLE), new_record(OUTPUTS), new_record(LEARNED)
        self.inputs, self.estimate = new_record(INPUTS), new_record(ESTIMATE)
        self.watched = new_record(INPUT_WATCH)
        self.watched["value"] = self.watched["sigma"] = self.watched["ratio"] = np.nan
        self.watched["unused_s"] = np.inf
        self.cycle["speaks"] = 1
        self.outputs["mode"], self.outputs["grip_limit"] = 1, np.nan
        self.frames = new_record(FRAME, 100)
        self.number = 0

    def find(self, name: str, **found) -> None:
        """Set what the next cycles find of an input, by the fields of `INPUT_WATCH`."""
        for field, value in found.items():
            self.watched[field][0, INPUT[name]] = value

    def publish(self, cycles: int, *, frames: int = 0, lateness_us=50.0, **outputs) -> None:
        for name, value in outputs.items():
            self.outputs[name] = value
        for _ in range(cycles):
            stamp_ns = START_NS + self.number * CYCLE_NS
            self.cycle["number"], self.cycle["frames"], self.cycle["t_ns"] = self.number, frames, stamp_ns
            self.cycle["t_mono_ns"] = MONO_NS + self.number * CYCLE_NS
            self.cycle["lateness_ns"] = round(1e3 * lateness_us)
            self.frames["stamp_ns"], self.frames["can_id"] = stamp_ns, 0x123
            self.frames["length"], self.frames["data"] = 8, np.arange(64)
            self._publish(self.frames)
            self.number += 1

    def publish_frames(self, frames) -> None:
        """Publish a cycle that consumed `frames`."""
        self.cycle["number"], self.cycle["frames"] = self.number, len(frames)
        self._publish(frames)
        self.number += 1

    def _publish(self, frames) -> None:
        measured = (self.outputs, self.inputs, self.estimate)
        publish(self.ring, self.cycle, *measured, self.learned, self.watched, frames)

    def close(self, **words) -> None:
        close_ring(self.ring, words)


@pytest.fixture
def rings(tmp_path, monkeypatch):
    """The folder of rings: the test's own."""
    folder = tmp_path / "rings"
    folder.mkdir()
    for module in (ring_module, __import__("ecu.watch.daemons", fromlist=["daemons"])):
        monkeypatch.setattr(module, "ring_folder", lambda: folder)
    return folder


@pytest.fixture
def loop(rings):
    """Start a loop of process `pid`."""

    def start(pid: int = 4711, **about) -> Loop:
        return Loop(rings / f"brake-ecu.1.{pid}.ring", **about)

    return start


@pytest.fixture
def contract_frames():
    """Make good frames of one message, one every 10 ms."""

    def make(name: str, count: int):
        plan = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "Vehicle")
        counters, buffer = new_transmission(plan), frame_buffer(plan)
        can_id = plan.ids[plan.messages["name"].tolist().index(name)]
        frames = new_record(FRAME, count)
        for number in range(count):
            sent = transmit(plan, counters, np.zeros(N_INPUTS), number, buffer)
            frames[number] = buffer[:sent][buffer["can_id"][:sent] == can_id][0]
            frames["stamp_ns"][number] = START_NS + number * CYCLE_NS
        return frames

    return make


@pytest.fixture
def serve_here():
    """Start a server of a handler; it looks every 10 ms, not twice a second, whether the test has ended."""
    with ExitStack() as stack:

        def start(handler, address="127.0.0.1") -> Server:
            server = stack.enter_context(Server(address, 0, handler))
            often = {"poll_interval": 0.01}
            threading.Thread(target=server.serve_forever, kwargs=often, daemon=True).start()
            stack.callback(server.shutdown)
            return server

        yield start
