"""Diagnostic messages on a bus: ISO-TP (ISO 15765-2) by can-isotp, over any interface of python-can.

Normal addressing, classical frames of eight bytes padded with 0xCC. The server answers one request at a
time: one that comes while a response is in progress waits for its end, at most the time-out of a flow control
(1 s).
"""

import logging
from collections import deque
from typing import Any, Final, NamedTuple

import can

from ecu.bus.addresses import NEEDS, STANDARD, can_filters
from ecu.bus.channel import open_bus, read_frames
from ecu.errors import UserError

PADDING: Final = 0xCC
WAITING: Final = 8
"""Requests that wait; of more the newest are lost."""
TIMEOUT_MS: Final = 1000
"""N_Bs and N_Cr."""
MOST_AT_ONCE: Final = 64
SEND_S: Final = 0.1
_SINGLE_FRAME: Final = 7
"""Bytes of the longest request to all ECUs: it has no flow control."""

_ISOTP_LOG: Final = logging.getLogger("isotp")
_ISOTP_LOG.addHandler(logging.NullHandler())  # a tester's slips are not the daemon's lines
_ISOTP_LOG.propagate = False


class Request(NamedTuple):
    """A message that came in."""

    data: bytes
    functional: bool


class Link:
    """One end of the connection: identifiers that it `sends` and `hears`, and that of all ECUs, if any."""

    def __init__(
        self, interface: str, channel: str, sends: int, hears: int, hears_all: int | None = None
    ) -> None:
        """Open the bus. Raises UserError: it cannot be opened, or can-isotp is missing."""
        isotp = load_isotp()
        wanted = [hears] if hears_all is None else [hears, hears_all]
        self._bus = open_bus(interface, channel, can_filters=can_filters(wanted))
        self._hears, self._hears_all = hears, hears_all
        self._frames: deque[Any] = deque()
        self._requests: deque[Request] = deque()
        mode = isotp.AddressingMode.Normal_29bits if hears > STANDARD else isotp.AddressingMode.Normal_11bits
        self._layer = isotp.TransportLayerLogic(
            rxfn=lambda timeout: self._frames.popleft() if self._frames else None,
            txfn=self._transmit,
            address=isotp.Address(mode, rxid=hears, txid=sends),
            params={
                "tx_padding": PADDING,
                "blocksize": 0,
                "rx_flowcontrol_timeout": TIMEOUT_MS,
                "rx_consecutive_frame_timeout": TIMEOUT_MS,
                "wftmax": 8,
            },
        )
        self._message = isotp.CanMessage

    @property
    def is_busy(self) -> bool:
        """True while a message is in progress, in either direction."""
        return self._layer.transmitting() or self._layer.is_rx_active()

    def turn(self, timeout_s: float) -> None:
        """Wait for frames at most that long, take those that have come, and send what is due.

        Raises:
            can.CanError, OSError: the bus is gone.
        """
        for frame in read_frames(self._bus, timeout_s, MOST_AT_ONCE):
            self._sort(frame)
        self._layer.process()
        while (data := self._layer.recv()) is not None:
            self._queue(Request(bytes(data), functional=False))

    def _sort(self, frame: can.Message) -> None:
        """Take a frame to this end; only whole requests are taken from those to all."""
        if frame.is_extended_id != (self._hears > STANDARD):
            return
        if frame.arbitration_id == self._hears:
            self._frames.append(
                self._message(frame.arbitration_id, data=frame.data, extended_id=frame.is_extended_id)
            )
        elif frame.arbitration_id == self._hears_all and frame.data:
            length = frame.data[0]
            if 0 < length <= min(_SINGLE_FRAME, len(frame.data) - 1):
                self._queue(Request(bytes(frame.data[1 : 1 + length]), functional=True))

    def _queue(self, request: Request) -> None:
        if len(self._requests) < WAITING:
            self._requests.append(request)

    def next(self) -> Request | None:
        """Return the next request, None: none, or the last response has not left yet."""
        if self._layer.transmitting() or not self._requests:
            return None
        return self._requests.popleft()

    def send(self, data: bytes) -> None:
        """Begin to send a message. Raises as `turn`."""
        self._layer.send(data)
        self._layer.process()

    def _transmit(self, message: Any) -> None:
        self._bus.send(
            can.Message(
                arbitration_id=message.arbitration_id,
                is_extended_id=message.is_extended_id,
                data=message.data,
            ),
            timeout=SEND_S,
        )

    def close(self) -> None:
        """Close the bus."""
        self._bus.shutdown()


def load_isotp() -> Any:
    """Return can-isotp. Raises UserError: it is not installed."""
    try:
        import isotp
    except ModuleNotFoundError:
        raise UserError("diagnostics", "", NEEDS) from None
    return isotp
