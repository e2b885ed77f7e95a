"""The tables of docs/diagnostics.md, from those of the code; `write_reference.py` writes them into it."""

from pathlib import Path
from typing import Final

from ecu.contract.faults import WORD
from ecu.diagnostics import read_faults, services, session
from ecu.diagnostics.identifiers import MEASURED, SESSION, TEXTS, UNITS, has_corners, scaling_of
from ecu.diagnostics.server import SELF_TESTS
from ecu.diagnostics.trouble_codes import FAILURE_TYPES, TROUBLE_CODES
from page_tables import filled, table

PAGE: Final = Path(__file__).parent.parent / "docs/diagnostics.md"

_SERVICES: Final = {
    services.SESSION_CONTROL: ("DiagnosticSessionControl", "01 default, 03 extended"),
    services.RESET: ("ECUReset", "01; not while armed"),
    services.CLEAR: ("ClearDiagnosticInformation", "FFFFFF or one code; 0x78 first, as it is stored"),
    services.READ_FAULTS: ("ReadDTCInformation", "01, 02, 04, 06, 0A; DTCFormat_00 of SAE J2012-DA"),
    services.READ_DATA: ("ReadDataByIdentifier", f"up to {services.MOST_IDENTIFIERS} at once"),
    services.SECURITY_ACCESS: ("SecurityAccess", "01 seed, 02 key; with a key file"),
    services.COMMUNICATION_CONTROL: ("CommunicationControl", "refused"),
    services.WRITE_DATA: ("WriteDataByIdentifier", "0118, with access; 0x78 first, as the loop is asked"),
    services.ROUTINE_CONTROL: ("RoutineControl", "01 start; of the self-test 03 results; 0x78 as there"),
    services.TESTER_PRESENT: ("TesterPresent", "00"),
    services.DTC_SETTING: ("ControlDTCSetting", "01 on, 02 off; on again with the end of the session"),
}


def with_tables(page: str) -> str:
    """Return the page with its tables as the code has them."""
    return filled(page, (_services(), _identifiers(), _codes()))


def _services() -> list[str]:
    lines = [
        "## Services",
        "",
        f"P2 {session.P2_MS} ms, P2* {session.P2_STAR_MS // 1000} s, S3 {session.S3_S:g} s."
        " A positive response is left out where the sub-function says so",
        "(suppressPosRspMsgIndicationBit), refusals 11, 12, 31, 7E and 7F where the request was to all ECUs.",
        "",
    ]
    rows = []
    for number, service in services.SERVICES.items():
        name, what = _SERVICES[number]
        rows.append((f"{number:02X}", name, "any" if service.in_default else "extended", what))
    routines = ", ".join(f"{number:04X} {name}" for number, name in services.ROUTINES.items())
    results = "; ".join(SELF_TESTS)
    return [
        *lines,
        *table("| | service | session | |", rows),
        "",
        f"Routines: {routines}.",
        "New pads have a byte with a bit of each corner, 01 fl, 02 fr, 04 rl, 08 rr. Both ask for access.",
        f"The self-test has a byte (0 passed, 1 failed, 2 not tested) for each of: {results}.",
        "",
        f"Snapshot records {read_faults.FIRST:02X}, {read_faults.LAST:02X}; extended data"
        f" {read_faults.OCCURRENCES:02X} (occurrences), {read_faults.AGEING:02X} (ageing).",
    ]


def _identifiers() -> list[str]:
    lines = [
        "## Data identifiers",
        "",
        "Most significant byte first; value = raw × scale + offset, as in"
        " [brake_ecu.dbc](../dbc/brake_ecu.dbc), in whole bytes.",
        "Quantities of four corners: fl, fr, rl, rr, one after the other.",
        "",
        "| | quantity | unit | bytes | scale | offset | not available |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in MEASURED:
        scaling = scaling_of(one)
        none = scaling.not_available
        code = "" if none is None else f"0x{none % (1 << 8 * scaling.bytes):0{2 * scaling.bytes}X}"
        size = f"4 × {scaling.bytes}" if has_corners(one) else f"{scaling.bytes}"
        sign = " signed" if scaling.signed else ""
        lines.append(
            f"| {one.number:04X} | `{one.name}` | {UNITS[one.name]} | {size}{sign} | {scaling.scale:g}"
            f" | {scaling.offset:g} | {code} |"
        )
    lines.append(f"| {SESSION:04X} | active session | | 1 | | | |")
    return [*lines, *(f"| {number:04X} | {name} | | text | | | |" for number, name in TEXTS.items())]


def _codes() -> list[str]:
    lines = [
        "## Trouble codes",
        "",
        "A chassis code of the manufacturer's range, C1000 and the number of the fault's bit in hexadecimal"
        " (from 32 on: `active_faults_2`),",
        "with the failure type of SAE J2012-DA that fits. Meaning and remedy: [faults.md](faults.md).",
        "",
    ]
    rows = []
    for code in TROUBLE_CODES:
        word, bit = divmod(code.fault.bit.bit_length() - 1, WORD)
        place, kind = f"{bit}" if word == 0 else f"2: {bit}", FAILURE_TYPES[code.number & 0xFF]
        rows.append((code.text, f"{code.number:06X}", place, code.fault.name, kind))
    return [*lines, *table("| code | bytes | bit | fault | failure type |", rows)]
