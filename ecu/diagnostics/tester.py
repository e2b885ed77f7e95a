"""`brake-ecu diag`: a small tester. It has the tables of this program, and names what another numbers."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import can

from ecu.bus.addresses import Addresses, parse_addresses
from ecu.diagnostics import read_faults
from ecu.diagnostics.fault_memory import AGEING_CYCLES, CONFIRMED, STATUS_NAMES, TEST_FAILED
from ecu.diagnostics.identifiers import (
    BY_NAME,
    BY_NUMBER,
    PAD_THICKNESS,
    TEXTS,
    UNITS,
    snapshot_values,
    to_values,
)
from ecu.diagnostics.services import ALL_GROUPS, CLEAR, NEGATIVE, POSITIVE, READ_DATA, READ_FAULTS
from ecu.diagnostics.session import P2_STAR_MS, REASONS, Reason
from ecu.diagnostics.tester_work import HINTS, WORKS, Ask, do, request_of, secret_of
from ecu.diagnostics.transport import Link
from ecu.diagnostics.trouble_codes import BY_NUMBER as CODES
from ecu.diagnostics.trouble_codes import TROUBLE_CODES, code_text
from ecu.errors import RunFault, UserError, closest
from ecu.output import give

PATIENCE_S: Final = 1.0
"""For the first byte of a response; P2 is 50 ms, and transmission in both directions."""
PATIENCE_PENDING_S: Final = 1e-3 * P2_STAR_MS
TURN_S: Final = 0.01
ACTIONS: Final = ("faults", "clear", "read", "info", *WORKS)
WITHOUT_NAMES: Final = ("faults", "info", "forget")


class Tester:
    """One connection to an ECU."""

    def __init__(self, link: Link, addresses: Addresses, now_s: Callable[[], float] = time.monotonic) -> None:
        self._link, self._addresses, self._now_s = link, addresses, now_s

    def ask(self, request: bytes) -> bytes:
        """Return the positive response to a request, without its service identifier.

        Raises:
            RunFault: there is no answer in time, or it is negative.
        """
        try:
            self._link.send(request)
            begun_s, patience_s = self._now_s(), PATIENCE_S
            while self._now_s() - begun_s < patience_s or self._link.is_busy:
                self._link.turn(TURN_S)
                heard = self._link.next()
                if heard is None:
                    continue
                if heard.data[:3] == bytes([NEGATIVE, request[0], Reason.PENDING]):
                    begun_s, patience_s = self._now_s(), PATIENCE_PENDING_S
                elif heard.data[:1] == bytes([request[0] + POSITIVE]):
                    return heard.data[1:]
                elif heard.data[:2] == bytes([NEGATIVE, request[0]]) and len(heard.data) == 3:
                    code = heard.data[2]
                    reason = REASONS.get(code, f"0x{code:02X}")
                    hint = HINTS.get((request[0], code))
                    reason += f": {hint}" if hint else ""
                    raise RunFault(f"service 0x{request[0]:02X} refused: {reason}")
        except (can.CanError, OSError) as error:
            raise RunFault(f"the bus failed: {error}") from None
        request_id, response_id, _ = self._addresses
        raise RunFault(
            f"no answer within {patience_s:g} s on 0x{response_id:X} to a request on 0x{request_id:X}: does"
            f" `run --diagnostics` answer there, on these identifiers?"
        )


def diag(
    action: str, names: Sequence[str], interface: str, channel: str, ids: str, key: Path | None = None
) -> int:
    """Ask the ECU and print what it answers; return 1 if it has confirmed faults.

    `key`: file of the secret that gives access, for what changes the learned values.

    Raises:
        UserError: an argument is wrong, or the bus cannot be opened.
        RunFault: it does not answer, or refuses.
    """
    if action not in ACTIONS:
        raise UserError("diag", action, f"not known; take {', '.join(ACTIONS)}{closest(action, ACTIONS)}")
    if names and action in WITHOUT_NAMES:
        raise UserError("diag", names[0], f"{action} takes no name")
    addresses = parse_addresses("--ids", ids)
    work = request_of(action, names) if action in WORKS else b""
    secret = secret_of(action, key)
    numbers = [_number(name) for name in names] if action == "read" else []
    codes = [_code(name) for name in names] if action == "clear" else []
    link = Link(interface, channel, addresses.request, addresses.response)
    try:
        ask = Tester(link, addresses).ask
        if action == "faults":
            return _faults(ask)
        if action == "clear":
            return _clear(ask, codes)
        if work:
            do(ask, work, secret)
            print(f"done and stored: {action}")
            give(done=action)
            return 0 if action == "forget" else _read(ask, [PAD_THICKNESS.number])
        return _read(ask, list(TEXTS) if action == "info" else numbers or list(BY_NUMBER))
    finally:
        link.close()


def _number(name: str) -> int:
    """Return an identifier of data by its name or number."""
    if name in BY_NAME:
        return BY_NAME[name].number
    texts = {text: number for number, text in TEXTS.items()}
    if name in texts:
        return texts[name]
    try:
        number = int(name, 16)
    except ValueError:
        number = -1
    if not 0 <= number <= 0xFFFF:
        known = [*BY_NAME, *texts]
        raise UserError("diag read", name, f"give a name or a number such as 0x0110{closest(name, known)}")
    return number


def _code(name: str) -> int:
    """Return a trouble code by its text, or by its three bytes."""
    known = {code.text: code.number for code in TROUBLE_CODES}
    known |= {f"{code.number:06X}": code.number for code in TROUBLE_CODES}
    if name.upper() not in known:
        raise UserError("diag clear", name, f"no trouble code of this ECU{closest(name.upper(), known)}")
    return known[name.upper()]


def _faults(ask: Ask) -> int:
    listed = ask(bytes([READ_FAULTS, read_faults.BY_MASK, CONFIRMED]))[2:]
    found = []
    for at in range(0, len(listed) - 3, 4):
        number, status = int.from_bytes(listed[at : at + 3], "big"), listed[at + 3]
        found.append(_details(ask, number, status))
    for fault in found:
        print(f"{fault['code']}  {fault['name']}: {'active' if fault['active'] else 'not active now'}")
        ageing = f"ageing {fault['ageing']} of {AGEING_CYCLES} starts"
        print(f"  {fault['occurrences']} times, {ageing}; {fault['remedy']}")
        for label in ("first",) if fault["first"] == fault["last"] else ("first", "last"):
            if text := _snapshot_text(fault[label]):
                print(f"  {label}: {text}")
    if not found:
        print("no confirmed fault")
    give(faults=found)
    return 1 if found else 0


def _details(ask: Ask, number: int, status: int) -> dict[str, object]:
    key, known = number.to_bytes(3, "big"), CODES.get(number)
    data = ask(bytes([READ_FAULTS, read_faults.EXTENDED_DATA]) + key + bytes([read_faults.ALL]))[5:]
    records = dict(zip(data[::2], data[1::2], strict=False))
    return {
        "code": code_text(number),
        "name": known.fault.name if known else "not known to this program",
        "remedy": known.fault.remedy if known else "",
        "active": bool(status & TEST_FAILED),
        "status": [name for place, name in enumerate(STATUS_NAMES) if status >> place & 1],
        "occurrences": records.get(read_faults.OCCURRENCES, 0),
        "ageing": records.get(read_faults.AGEING, 0),
        "first": _snapshot(ask, key, read_faults.FIRST),
        "last": _snapshot(ask, key, read_faults.LAST),
    }


def _snapshot(ask: Ask, key: bytes, record: int) -> dict[str, list[float | None]]:
    return snapshot_values(ask(bytes([READ_FAULTS, read_faults.SNAPSHOT]) + key + bytes([record]))[7:])


def _snapshot_text(values: object) -> str:
    if not isinstance(values, dict) or not values:
        return ""
    clock = values.get("clock", [0.0])[0] or 0.0
    when = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(clock))
    others = (
        f"{name} {_numbers(numbers)} {_unit(name)}" for name, numbers in values.items() if name != "clock"
    )
    return ", ".join([when, *(text.rstrip() for text in others)])


def _numbers(values: Sequence[float | None]) -> str:
    return "/".join("–" if value is None else f"{value:.13g}" for value in values)


def _unit(name: str) -> str:
    return UNITS[name].replace("-", "")


def _clear(ask: Ask, codes: Sequence[int]) -> int:
    for number in codes or [ALL_GROUPS]:
        ask(bytes([CLEAR]) + number.to_bytes(3, "big"))
    print(f"cleared: {', '.join(map(code_text, codes)) or 'all'}")
    give(cleared=[code_text(number) for number in codes] or ["all"])
    return 0


def _read(ask: Ask, numbers: Sequence[int]) -> int:
    found: dict[str, object] = {}
    for number in numbers:
        key = number.to_bytes(2, "big")
        data = ask(bytes([READ_DATA]) + key)
        if data[:2] != key:
            raise RunFault(f"asked for 0x{number:04X}, the answer is of another")
        known = BY_NUMBER.get(number)
        if known:
            values = to_values(known, data[2:])
            print(f"{known.name} {_numbers(values)} {_unit(known.name)}".rstrip())
            found[known.name] = values if len(values) > 1 else values[0]
        elif number in TEXTS:
            print(f"{TEXTS[number]} {data[2:].decode(errors='replace')}")
            found[TEXTS[number]] = data[2:].decode(errors="replace")
        else:
            print(f"0x{number:04X} {data[2:].hex(' ')}")
            found[f"0x{number:04X}"] = data[2:].hex()
    give(values=found)
    return 0
