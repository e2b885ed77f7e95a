"""Settings of `run --xcp`: checked before READY, handed to its process as a word."""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple

from ecu.bus.addresses import check_ipv4, parse_addresses, refuse_taken
from ecu.errors import UserError
from ecu.runtime.diagnostics import read_secret

OPTION: Final = "--xcp"
KEY_OPTION: Final = "--xcp-key"
SAVE_OPTION: Final = "--xcp-save"
SAVED: Final = f"# Calibrated by an XCP master: written by brake-ecu run {SAVE_OPTION}"
"""First line of the file."""
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
    check_ipv4(OPTION, text, address or LOOPBACK)
    return Transport(kind, address or LOOPBACK, int(port))


class Calibrating(NamedTuple):
    """Options of calibration."""

    key: Path | None = None
    """File of the secret: without it nothing can be written."""
    save: Path | None = None
    """CONFIG file for a calibration that is stored."""


class Settings(NamedTuple):
    """Where the slave listens, the bus of the run, and the files of calibration, empty: none."""

    transport: str
    """As given."""
    interface: str
    channel: str
    key: str = ""
    save: str = ""


def checked_settings(
    transport: str | None,
    interface: str,
    channel: str,
    taken: set[int],
    silent: bool,
    calibrating: Calibrating,
    inputs: Iterable[Path],
) -> str | None:
    """Return the settings as JSON, an argument of the process; None where no XCP is asked for.

    Args:
        transport: as given.
        interface: of the run.
        channel: of the run.
        taken: identifiers of other messages, those of 29 bits with `EXTENDED_ID`.
        silent: the run sends nothing.
        calibrating: as given.
        inputs: the files of CONFIG.

    Raises:
        UserError: it cannot be served, or a file is the wrong one.
    """
    key, save = calibrating
    if key is None and save is not None:
        raise UserError(SAVE_OPTION, str(save), f"is for calibration; give {KEY_OPTION} too")
    if transport is None:
        if key is not None:
            raise UserError(KEY_OPTION, str(key), f"is for a master; give {OPTION} too")
        return None
    if key is not None:
        read_secret(key)
    if save is not None:
        _check_save(save, inputs)
    found = parse_transport(transport)
    if found.kind == "can":
        if silent:
            remedy = "answers on the bus, where a --silent run sends nothing; give udp: or tcp:"
            raise UserError(OPTION, transport, remedy)
        refuse_taken(OPTION, (found.request, found.response), taken)
    files = ("" if path is None else str(path.absolute()) for path in calibrating)
    return json.dumps(Settings(transport, interface, channel, *files))


def _check_save(save: Path, inputs: Iterable[Path]) -> None:
    """Raise UserError for a file that must not be overwritten, or cannot be written."""
    if any(save.exists() and save.samefile(one) for one in inputs):
        raise UserError(SAVE_OPTION, str(save), "is read by this run; give another name")
    if not save.absolute().parent.is_dir():
        raise UserError(SAVE_OPTION, str(save), "its folder does not exist; make it")
    try:
        with save.open(encoding="utf-8", errors="replace") as file:
            ours = file.readline().rstrip() == SAVED
    except FileNotFoundError:
        return
    except OSError as error:
        raise UserError(SAVE_OPTION, str(save), f"cannot be read: {error.strerror}") from None
    if not ours:
        raise UserError(SAVE_OPTION, str(save), "exists, and no calibration wrote it; give another name")
