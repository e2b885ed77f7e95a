"""The loop of the XCP slave: commands from a master, cycles from the ring, packets to the master."""

import secrets
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final

import can
import numpy as np

from ecu.contract.records import RecordArray
from ecu.diagnostics.session import SEED_BYTES
from ecu.recording.ring import Batch, RingReader
from ecu.runtime.clock import monotonic_s
from ecu.runtime.diagnostics import read_secret
from ecu.runtime.place import Place
from ecu.runtime.xcp import Settings, parse_transport
from ecu.xcp.a2l import a2l_text
from ecu.xcp.calibration import Calibration
from ecu.xcp.memory import Image, images
from ecu.xcp.parameters import to_record
from ecu.xcp.slave import Slave
from ecu.xcp.takeover import Takeover
from ecu.xcp.transport import CAN, ETHERNET, Can, End, Tcp, Udp

PERIOD_S: Final = 0.1
MEASURING_S: Final = 0.01
BLOCKED_S: Final = 0.002
"""Longest wait for commands: idle, while lists run, and while there is no room for a packet."""
AT_ONCE: Final = 50
"""Cycles that become packets before commands have their turn."""


class Server:
    """Slave of one run, by its ring."""

    def __init__(self, ring: Path, settings: Settings) -> None:
        """Raises UserError: there is no ring, or no secret in the file of the key."""
        self.reader = RingReader(ring, asks=bool(settings.key))
        self.transport = parse_transport(settings.transport)
        self._configuration = self.reader.description["configuration"]
        self._parameters = to_record(self._configuration)
        self._takeover: Takeover | None = None
        self._image: Image | None = None
        self._speaks = False
        self._lost = 0
        self._due: deque[bytes] = deque()
        """Packets with measured data that wait for room."""
        calibration = self._calibration(settings) if settings.key else None
        clock = lambda: round(1e9 * monotonic_s())  # noqa: E731
        a2l = lambda: a2l_text([self.transport], self._configuration)  # noqa: E731
        size = CAN if self.transport.kind == "can" else ETHERNET
        self.slave = Slave(size, lambda: self._image, clock, a2l, calibration)
        self.place = Place("xcp", lambda: self._open(settings))

    def _calibration(self, settings: Settings) -> Calibration:
        self._takeover = Takeover(self.reader, Path(settings.save) if settings.save else None)
        secret = read_secret(Path(settings.key))
        return Calibration(self._takeover, secret, lambda: secrets.token_bytes(SEED_BYTES))

    def _parameters_of(self, batch: Batch) -> RecordArray:
        cycles = batch.records["cycle"]
        if self._takeover is not None:
            return self._takeover.parameters_of(cycles)
        return np.repeat(self._parameters, len(cycles))

    def _open(self, settings: Settings) -> End:
        transport = self.transport
        if transport.kind == "can":
            return Can(settings.interface, settings.channel, transport.request, transport.response)
        if transport.kind == "udp":
            return Udp(transport.address, transport.port, lambda: self.slave.connected)
        return Tcp(transport.address, transport.port, lambda: self.slave.connected, self._end_session)

    def _end_session(self) -> bytes:
        self._due.clear()
        return self.slave.end()

    def follow(self) -> None:
        """Take the new cycles of the ring: the last one is what a master reads, all are what it measures."""
        while not self._due and len((batch := self.reader.read(AT_ONCE)).records):
            measuring = self.slave.daq.running
            taken = batch if measuring else Batch(*(part[-1:] for part in batch))
            found = images(taken, self._parameters_of(taken))
            if measuring:
                if self.reader.lost_cycles > self._lost:
                    self._due.append(self.slave.overload())
                for cycle, image in zip(taken.records["cycle"], found, strict=True):
                    packets = self.slave.daq.packets(int(cycle["number"]), int(cycle["t_mono_ns"]), image)
                    self._due.extend(packets)
            self._lost = self.reader.lost_cycles
            self._image = found[-1]
            self._speaks = bool(taken.records["cycle"]["speaks"][-1])

    def turn(self) -> None:
        """Wait for commands and answer them, then send what was measured."""
        end = self.place.end()
        if end is None:
            time.sleep(PERIOD_S)
            self.follow()
            return
        try:
            for command in end.commands(self._wait_s()):
                self._answer(end, command)
            self._send_measured(end)
        except (can.CanError, OSError) as error:
            self._end_session()
            self.place.lose(error)

    def _send_measured(self, end: End) -> None:
        self.follow()
        while self._due and end.send(self._due[0]):
            self._due.popleft()

    def _wait_s(self) -> float:
        if self._due:
            return BLOCKED_S
        return MEASURING_S if self.slave.daq.running else PERIOD_S

    def _answer(self, end: End, command: bytes) -> None:
        self.follow()
        if self.transport.kind == "can" and not self._speaks:
            return  # a standby that is silent leaves answering to the first one
        response = self.slave.answer(command)
        if not self.slave.daq.running:
            self._due.clear()
        for packet in [] if response is None else [response, *self.slave.events()]:
            end.send(packet)

    def finish(self) -> None:
        """Send what is left and say that the session has ended."""
        end = self.place.end()
        if end is not None and self.slave.connected:
            self._send_measured(end)
            end.send(self._end_session())
        self.place.close()


def serve(ring: Path, settings: Settings, goes_on: Callable[[], bool]) -> None:
    """Answer until the run has ended or `goes_on` says no.

    Raises:
        UserError: there is no ring.
    """
    server = Server(ring, settings)
    while goes_on() and not server.reader.closed:
        server.turn()
    server.finish()
