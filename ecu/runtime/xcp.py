"""Settings of `run --xcp`: checked before READY, handed to its process as a word."""

import json
import re
from ipaddress import IPv4Address
from typing import Final, NamedTuple

from ecu.bus.addresses import parse_addresses, refuse_taken
from ecu.errors import UserError

OPTION: Final = "--xcp"
LOOPBACK: Final = "127.0.0.1"
REMEDY: Final = (
    "give udp:[ADDRESS:]PORT, tcp:[ADDRESS:]PORT or can:REQUEST:RESPONSE, as in udp:127.0.0.1:5555"
)


class Transport(NamedTuple):
    """Where a master reaches the slave: `first` and `second` are address and port, or identifiers."""

    kind: str
    """udp, tcp or can."""
    address: str = LOOPBACK
    port: int = 0
    request: int = 0
    response: int = 0


def parse_transport(text: str) -> Transport:
    """Return what `udp:127.0.0.1:5555`, `tcp:5555` or `can:0x7A0:0x7A8` means.

    Raises:
        UserError: it means nothing.
    """
    kind, _, rest = text.partition(":")
    if kind == "can" and rest.count(":") == 1:
        request, response, _ = parse_addresses(OPTION, rest)
        return Transport(kind, request=request, response=response)
    address, _, port = rest.rpartition(":")
    if kind not in ("udp", "tcp") or not re.fullmatch(r"[0-9]{1,5}", port) or not 0 < int(port) < 1 << 16:
        raise UserError(OPTION, text, REMEDY)
    try:
        IPv4Address(address or LOOPBACK)
    except ValueError:
        raise UserError(OPTION, text, "give an IPv4 address, 127.0.0.1 or 0.0.0.0") from None
    return Transport(kind, address or LOOPBACK, int(port))


class Settings(NamedTuple):
    """Where the slave listens, and the bus of the run."""

    transport: str
    """As given."""
    interface: str
    channel: str

    def word(self) -> str:
        """Return them as an argument of a process."""
        return json.dumps(self)


def read_settings(word: str) -> Settings:
    """Return what `Settings.word` wrote."""
    return Settings(*json.loads(word))


def checked_settings(
    transport: str | None, interface: str, channel: str, taken: set[int], silent: bool
) -> str | None:
    """Return the settings as a word, None where no XCP is asked for.

    Args:
        transport: as given.
        interface: of the run.
        channel: of the run.
        taken: identifiers of other messages, those of 29 bits with `EXTENDED_ID`.
        silent: the run sends nothing.

    Raises:
        UserError: it cannot be served.
    """
    if transport is None:
        return None
    found = parse_transport(transport)
    if found.kind == "can":
        if silent:
            remedy = "answers on the bus, where a --silent run sends nothing; give udp: or tcp:"
            raise UserError(OPTION, transport, remedy)
        refuse_taken(OPTION, (found.request, found.response), taken)
    return Settings(transport, interface, channel).word()
