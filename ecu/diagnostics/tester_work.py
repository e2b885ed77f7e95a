"""What a workshop asks of a running ECU (`brake-ecu diag`): requests, access, and what a refusal means."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from ecu.contract.signals import CORNERS
from ecu.diagnostics.identifiers import PAD_THICKNESS, to_bytes
from ecu.diagnostics.services import (
    FORGET,
    NEW_PADS,
    ROUTINE_CONTROL,
    SECURITY_ACCESS,
    SESSION_CONTROL,
    START,
    WRITE_DATA,
)
from ecu.diagnostics.session import DEFAULT, EXTENDED, Reason, key_of
from ecu.errors import RunFault, UserError, closest
from ecu.pads import PLACES, parse_measured
from ecu.runtime.diagnostics import KEY_OPTION, read_secret

WORKS: Final = ("new-pads", "measured", "forget")
HINTS: Final[dict[tuple[int, int], str]] = {
    (SECURITY_ACCESS, Reason.CONDITIONS_NOT_CORRECT): f"the ECU has no key; start it with {KEY_OPTION} FILE",
    (SECURITY_ACCESS, Reason.INVALID_KEY): f"--key is another file than that of {KEY_OPTION}",
    **{
        (service, code): hint
        for service in (ROUTINE_CONTROL, WRITE_DATA)
        for code, hint in {
            Reason.CONDITIONS_NOT_CORRECT: (
                "stop, release the brake, wait a second; and the ECU needs --state"
            ),
            Reason.OUT_OF_RANGE: "a pad thicker than before, or next to none; give its lining in mm",
            Reason.BUSY: "another change is in progress; ask again",
            Reason.ACCESS_DENIED: "another tester ended the session; ask again",
            Reason.PROGRAMMING_FAILURE: "done, but not stored; the ECU's log says why",
        }.items()
    },
}
"""What to do about a refusal of a service, by its code."""

Ask = Callable[[bytes], bytes]


def secret_of(action: str, key: Path | None) -> bytes:
    """Return the secret in the file `key`. Raises UserError: only WORKS need it, or it is none."""
    if key is None and action in WORKS:
        raise UserError("diag", action, f"give --key FILE, that of {KEY_OPTION}")
    if key is not None and action not in WORKS:
        raise UserError("diag", "--key", f"is for {', '.join(WORKS)}; leave it out")
    return b"" if key is None else read_secret(key)


def request_of(action: str, names: Sequence[str]) -> bytes:
    """Return the request for one of WORKS. Raises UserError for a corner or thickness that is none."""
    if action == "forget":
        return bytes([ROUTINE_CONTROL, START]) + FORGET.to_bytes(2, "big")
    if action == "new-pads":
        for name in names or ("",):
            if name not in PLACES:
                raise UserError("diag new-pads", name, f"name {', '.join(PLACES)}{closest(name, PLACES)}")
        corners = sum({1 << i for name in names for i in PLACES[name]})
        return bytes([ROUTINE_CONTROL, START]) + NEW_PADS.to_bytes(2, "big") + bytes([corners])
    found = parse_measured(",".join(names), "diag measured")
    values = np.array([found.get(i, math.nan) for i in range(len(CORNERS))])
    number = PAD_THICKNESS.number.to_bytes(2, "big")
    return bytes([WRITE_DATA]) + number + to_bytes(PAD_THICKNESS, {PAD_THICKNESS.name: values})


def do(ask: Ask, work: bytes, secret: bytes) -> None:
    """Have the running loop do what the request `work` says. Raises RunFault."""
    ask(bytes([SESSION_CONTROL, EXTENDED]))
    try:
        if any(seed := ask(bytes([SECURITY_ACCESS, 0x01]))[1:]):
            ask(bytes([SECURITY_ACCESS, 0x02]) + key_of(secret, seed))
        ask(work)
    finally:
        with suppress(RunFault):  # it ends by itself where nobody speaks
            ask(bytes([SESSION_CONTROL, DEFAULT]))
