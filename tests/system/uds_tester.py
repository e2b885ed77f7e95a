"""A foreign tester, udsoncan over can-isotp, for a daemon with diagnostics beside a car that drives."""

from contextlib import contextmanager

import can
import isotp
import udsoncan
from udsoncan import configs
from udsoncan.client import Client
from udsoncan.connections import PythonIsoTpConnection
from udsoncan.exceptions import TimeoutException, UnexpectedResponseException

from brakelab.testing.daemon import wait_for
from ecu import __version__
from ecu.bus.channel import open_bus
from ecu.diagnostics.identifiers import MEASURED, length_of, scaling_of
from ecu.diagnostics.session import key_of
from ecu.diagnostics.trouble_codes import TROUBLE_CODES

SECRET = "00112233445566778899aabbccddeeff"


class Numbers(udsoncan.DidCodec):
    """A quantity as the table of identifiers describes it."""

    def __init__(self, one):
        self.one, self.scaling = one, scaling_of(one)

    def decode(self, payload):
        size = self.scaling.bytes
        return [
            self.scaling.scale * int.from_bytes(payload[at : at + size], "big", signed=self.scaling.signed)
            + self.scaling.offset
            for at in range(0, len(payload), size)
        ]

    def encode(self, value):
        """Bytes of four values, None: not available."""
        none, scale = self.scaling.not_available, self.scaling.scale
        raw = [none if one is None else round((one - self.scaling.offset) / scale) for one in value]
        return b"".join(one.to_bytes(self.scaling.bytes, "big", signed=self.scaling.signed) for one in raw)

    def __len__(self):
        return length_of(self.one)


CONFIG = {
    **configs.default_client_config,
    "data_identifiers": {
        **{one.number: Numbers(one) for one in MEASURED},
        0xF189: udsoncan.AsciiCodec(len(__version__)),
        0xF1A1: udsoncan.AsciiCodec(3),
    },
    "extended_data_size": {code.number: 1 for code in TROUBLE_CODES},
    "request_timeout": 10,
    "p2_timeout": 5,
    "use_server_timing": False,  # this machine may be busy
    "security_algo": lambda level, seed, params: key_of(bytes.fromhex(SECRET), bytes(seed)),
}


@contextmanager
def foreign_tester(addresses=(0x7E0, 0x7E8), *, interface, channel, **config):
    """A client of udsoncan over can-isotp, with its bus as `bus`."""
    bus = open_bus(interface, channel)
    mode = isotp.AddressingMode.Normal_11bits if addresses[0] < 0x800 else isotp.AddressingMode.Normal_29bits
    notifier = can.Notifier(bus, [], timeout=0.05)
    stack = isotp.NotifierBasedCanStack(
        bus, notifier, address=isotp.Address(mode, txid=addresses[0], rxid=addresses[1])
    )
    try:
        with Client(PythonIsoTpConnection(stack), config={**CONFIG, **config}) as client:
            client.bus = bus
            yield client
    finally:
        notifier.stop()
        bus.shutdown()


def asked(client, ask):
    """Ask until there is an answer: the server begins after the loop."""
    found = []

    def answered():
        try:
            found.append(ask(client))
        except (TimeoutException, UnexpectedResponseException):  # none yet, or a late one to the last request
            return False
        return True

    wait_for(answered)
    return found[0]
