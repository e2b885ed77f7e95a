"""A small XCP master, by the standard alone: UDP, TCP or CAN; what it measures it keeps."""

import hmac
import socket
import struct
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

import can

from ecu.errors import RunFault
from ecu.xcp.variables import RECORDS

HEADER: Final = struct.Struct("<HH")
VARIABLES: Final = {
    f"{record.name}.{one.name}": (record.base + one.offset, one)
    for record in RECORDS
    for one in record.variables
}
"""Address of each variable, and the variable."""
PATIENCE_S: Final = 60.0
AT_ONCE: Final = 150
"""Numbers of eight bytes in a packet."""


def wait_for(fact: Callable[[], bool]) -> None:
    """Look again and again until `fact` holds. Raises RunFault if it does not."""
    end = time.monotonic() + PATIENCE_S
    while not fact():
        if time.monotonic() > end:
            raise RunFault("the slave of XCP does not answer")
        time.sleep(0.01)


class Transport(Protocol):
    """Carries packets in both directions."""

    lost: int

    def open(self) -> None:
        """Open it, as soon as there is somebody."""

    def send(self, packet: bytes) -> None:
        """Send a packet."""

    def receive(self) -> bytes:
        """Return the next packet. Raises TimeoutError if none comes."""

    def close(self) -> None:
        """Close it."""


class Refused(Exception):
    """A negative response, by its code."""


class Wire:
    """UDP or TCP; checks the counter of what comes."""

    def __init__(self, kind: str, port: int) -> None:
        self.stream, self.port = kind == "tcp", port
        self.open()

    def open(self) -> None:
        """Open it, as soon as there is somebody."""
        self.data, self.lost = b"", 0
        self.counter: int | None = None
        wait_for(self._opens)

    def _opens(self) -> bool:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM if self.stream else socket.SOCK_DGRAM)
        self.socket.settimeout(5.0)
        if not self.stream:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        try:
            self.socket.connect(("127.0.0.1", self.port))
        except ConnectionRefusedError:
            self.socket.close()
            return False
        return True

    def send(self, packet: bytes) -> None:
        """Send a packet."""
        self.socket.send(HEADER.pack(len(packet), 0) + packet)

    def receive(self) -> bytes:
        """Return the next packet. Raises OSError if none comes."""
        while True:
            if len(self.data) >= HEADER.size:
                length, counter = HEADER.unpack_from(self.data)
                end = HEADER.size + length
                if len(self.data) >= end:
                    packet, self.data = self.data[HEADER.size : end], self.data[end:]
                    if self.counter is not None:
                        self.lost += (counter - self.counter - 1) & 0xFFFF
                    self.counter = counter
                    return packet
            found = self.socket.recv(1 << 16)
            if not found:
                raise ConnectionResetError("the slave hung up")
            self.data = self.data + found if self.stream else found

    def close(self) -> None:
        """Close it."""
        self.socket.close()


class CanWire:
    """A pair of identifiers on a bus."""

    lost = 0

    def __init__(self, bus: can.BusABC, request: int, response: int) -> None:
        self.bus, self.request, self.response = bus, request, response

    def send(self, packet: bytes) -> None:
        """Send a packet."""
        self.bus.send(can.Message(arbitration_id=self.request, is_extended_id=False, data=packet))

    def receive(self) -> bytes:
        """Return the next packet. Raises OSError if none comes."""
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            frame = self.bus.recv(0.1)
            if frame is not None and frame.arbitration_id == self.response:
                return bytes(frame.data)
        raise TimeoutError("no answer")

    def close(self) -> None:
        """Close it."""
        self.bus.shutdown()


class Master:
    """Asks one question at a time; packets of lists that come meanwhile are kept in `packets`."""

    def __init__(self, wire: Transport) -> None:
        self.wire = wire
        self.packets: list[bytes] = []
        self.events: list[bytes] = []

    def ask(self, layout: str, *values: Any) -> bytes:
        """Send a command, packed; return what follows the first byte of the response."""
        self.wire.send(struct.pack(f"<{layout}", *values))
        while (packet := self.take())[0] < 0xFE:
            pass
        if packet[0] == 0xFE:
            raise Refused(packet[1])
        return packet[1:]

    def take(self) -> bytes:
        """Return the next packet, kept where it is no response."""
        packet = self.wire.receive()
        if packet[0] == 0xFD:
            self.events.append(packet)
        elif packet[0] < 0xFC:
            self.packets.append(packet)
        return packet

    def connect(self) -> "Master":
        """Connect as soon as there is an answer: the slave begins after the loop."""

        def answered() -> bool:
            try:
                return bool(self.ask("BB", 0xFF, 0))
            except TimeoutError:
                return False
            except ConnectionError:  # one that has died, or a port of UDP that nobody has yet
                self.wire.close()
                self.wire.open()
                return False

        wait_for(answered)
        return self

    def upload(self, address: int, length: int) -> bytes:
        """Return bytes from an address."""
        return self.ask("BBBBL", 0xF4, length, 0, 0, address)

    def value(self, name: str) -> Any:
        """Return a variable as it is now."""
        address, one = VARIABLES[name]
        return struct.unpack(f"<{one.kind.char}", self.upload(address, one.kind.itemsize))[0]

    def unlock(self, secret: bytes, most: int = 246) -> None:
        """Get access to calibration: the key is the first 16 bytes of HMAC-SHA-256 over the seed."""
        answer = self.ask("BBB", 0xF8, 0, 1)
        left, seed = answer[0], answer[1:]
        while len(seed) < left:
            seed += self.ask("BBB", 0xF8, 1, 1)[1:]
        key = hmac.digest(secret, seed, "sha256")[:16]
        for at in range(0, len(key), most):
            part = key[at : at + most]
            protected = self.ask(f"BB{len(part)}s", 0xF7, len(key) - at, part)
        assert protected == b"\x00"

    def download(self, name: str, *values: float, most: int = 246) -> None:
        """Write a variable of the working page, in as many pieces as it takes."""
        address, one = VARIABLES[name]
        self.ask("BHBL", 0xF6, 0, 0, address)
        data = struct.pack(f"<{len(values)}{one.kind.char}", *values)
        for at in range(0, len(data), most):
            part = data[at : at + most]
            self.ask(f"BB{len(part)}s", 0xF0, len(part), part)

    def take_over(self, page: int = 1) -> None:
        """Have the ECU go by a page."""
        self.ask("BBBB", 0xEB, 1, 0, page)

    def begin(self, odts: Sequence[Sequence[tuple[int, int]]], stamp: bool = True) -> None:
        """Set up list 0 with entries (address, length) of each packet, and start it."""
        self.ask("B", 0xD6)
        self.ask("BBH", 0xD5, 0, 1)
        self.ask("BBHB", 0xD4, 0, 0, len(odts))
        for number, entries in enumerate(odts):
            self.ask("BBHBB", 0xD3, 0, 0, number, len(entries))
        for number, entries in enumerate(odts):
            self.ask("BBHBB", 0xE2, 0, 0, number, 0)
            for address, length in entries:
                self.ask("BBBBL", 0xE1, 0xFF, length, 0, address)
        self.ask("BBHHBB", 0xE0, 0x10 if stamp else 0, 0, 0, 1, 0)
        self.start()

    def start(self) -> None:
        """Start list 0."""
        self.ask("BBH", 0xDE, 2, 0)
        self.ask("BB", 0xDD, 1)

    def stop(self) -> None:
        """Stop all lists."""
        self.ask("BB", 0xDD, 0)

    def begin_numbers(self, names: Sequence[str]) -> int:
        """Set up list 0 with variables of eight bytes, and start it; return how many packets a cycle has."""
        odts = [names[at : at + AT_ONCE] for at in range(0, len(names), AT_ONCE)]
        self.begin([[(VARIABLES[name][0], 8) for name in odt] for odt in odts])
        return len(odts)

    def measure(self, names: Sequence[str], packets: int) -> tuple[list[int], list[bytes]]:
        """Measure variables of eight bytes until so many packets have come; stop; return stamps and rows."""
        parts = self.begin_numbers(names)
        while len(self.packets) < packets * parts:
            self.take()
        self.stop()
        rows: list[bytes] = []
        stamps: list[int] = []
        for packet in self.packets:
            if packet[0] == 0:
                stamps.append(struct.unpack_from("<L", packet, 1)[0])
                rows.append(packet[5:])
            else:
                assert len(stamps) == len(rows)
                rows[-1] += packet[1:]
        return stamps, rows

    def close(self) -> None:
        """Close it."""
        self.wire.close()
