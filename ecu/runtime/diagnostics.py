"""Settings of `run --diagnostics`: checked before READY, handed to its process as a word."""

import json
import stat
from importlib.util import find_spec
from pathlib import Path
from typing import Final, NamedTuple

from ecu.bus.addresses import NEEDS, in_table, parse_addresses, refuse_taken
from ecu.errors import UserError

OPTION: Final = "--diagnostics"
KEY_OPTION: Final = "--diagnostics-key"
LEAST_SECRET: Final = 16  # bytes


class Settings(NamedTuple):
    """Where the server listens, and the file of its secret, empty: none."""

    interface: str
    channel: str
    addresses: str
    key: str


def checked_settings(
    interface: str, channel: str, addresses: str | None, key: Path | None, taken: set[int], silent: bool
) -> str | None:
    """Return the settings as JSON, an argument of the process; None where no diagnostics are asked for.

    Args:
        interface: of the run.
        channel: of the run.
        addresses: as given, REQUEST:RESPONSE[:ALL].
        key: file of the secret.
        taken: identifiers of the ECU's messages, those of 29 bits with `EXTENDED_ID`.
        silent: the run sends nothing.

    Raises:
        UserError: they cannot be served, or the key file is none.
    """
    if addresses is None:
        if key is not None:
            raise UserError(KEY_OPTION, str(key), f"is for a tester; give {OPTION} too")
        return None
    if silent:
        raise UserError(
            OPTION, addresses, "answers on the bus, where a --silent run sends nothing; leave one out"
        )
    if find_spec("isotp") is None:
        raise UserError(OPTION, "", NEEDS)
    refuse_taken(OPTION, parse_addresses(OPTION, addresses), taken)
    if key is not None:
        read_secret(key)
    return json.dumps(Settings(interface, channel, addresses, "" if key is None else str(key.absolute())))


def identifiers(addresses: str | None) -> set[int]:
    """Return the identifiers that diagnostics on `addresses` take, those of 29 bits with `EXTENDED_ID`."""
    return set() if addresses is None else {in_table(one) for one in parse_addresses(OPTION, addresses)}


def read_secret(path: Path) -> bytes:
    """Return the secret in a key file: hexadecimal digits, 16 bytes or more.

    Raises:
        UserError: it cannot be read, others can read it, or it is none.
    """
    try:
        if path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise UserError(str(path), "", "others may read this secret; chmod 600 it")
        secret = bytes.fromhex(path.read_text("ascii"))
    except OSError as error:
        raise UserError(str(path), "", f"cannot be read: {error.strerror}") from None
    except ValueError:
        secret = b""
    if len(secret) < LEAST_SECRET:
        raise UserError(
            str(path), "", f"no key: write {LEAST_SECRET} bytes or more in hexadecimal (openssl rand -hex 32)"
        )
    return secret
