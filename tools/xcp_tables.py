"""The tables of docs/xcp.md, from those of the code; `write_reference.py` writes them into it."""

from pathlib import Path
from typing import Final

from ecu.xcp.a2l import MEANINGS
from ecu.xcp.protocol import Command
from ecu.xcp.transport import CAN, ETHERNET
from ecu.xcp.variables import RECORDS
from page_tables import filled, table

PAGE: Final = Path(__file__).parent.parent / "docs/xcp.md"

_WHAT: Final = {
    Command.CONNECT: "mode 00; any session before it ends",
    Command.DISCONNECT: "",
    Command.GET_STATUS: "",
    Command.SYNCH: "",
    Command.GET_COMM_MODE_INFO: "no block modes, no interleaving",
    Command.GET_ID: "0 and 1: names; 4: the A2L file itself; 5: EPK. All by UPLOAD",
    Command.SET_REQUEST: "STORE_CAL_REQ; EV_STORE_CAL follows at once",
    Command.GET_SEED: "of CAL/PAG; 16 bytes, none where it is not locked",
    Command.UNLOCK: "16 bytes; a wrong key ends the session",
    Command.SET_MTA: "address extension 0",
    Command.UPLOAD: "of the last cycle; parameters: of the page",
    Command.SHORT_UPLOAD: "likewise",
    Command.DOWNLOAD: "into the working page; any piece of a value",
    Command.SHORT_DOWNLOAD: "likewise; not on CAN, where it has no room",
    Command.SET_CAL_PAGE: "for the ECU: checked and taken over; for the master: what UPLOAD reads",
    Command.GET_CAL_PAGE: "",
    Command.GET_PAG_PROCESSOR_INFO: "one segment",
    Command.GET_SEGMENT_INFO: "modes 0 and 1",
    Command.GET_PAGE_INFO: "",
    Command.COPY_CAL_PAGE: "reference to working page",
    Command.CLEAR_DAQ_LIST: "",
    Command.SET_DAQ_PTR: "",
    Command.WRITE_DAQ: "bit offset FF; over neighbouring variables too",
    Command.SET_DAQ_LIST_MODE: "time stamp or none; event 0; prescaler 1 to 255",
    Command.START_STOP_DAQ_LIST: "",
    Command.START_STOP_SYNCH: "stop all, start, stop and prepare selected ones",
    Command.GET_DAQ_CLOCK: "",
    Command.GET_DAQ_PROCESSOR_INFO: "dynamic lists, prescaler, time stamps, overload as an event",
    Command.GET_DAQ_RESOLUTION_INFO: "stamps of four bytes, 1 µs",
    Command.GET_DAQ_EVENT_INFO: "event 0: `cycle`, 10 ms",
    Command.FREE_DAQ: "",
    Command.ALLOC_DAQ: "",
    Command.ALLOC_ODT: "252 of all lists",
    Command.ALLOC_ODT_ENTRY: "4096 of all lists",
    Command.WRITE_DAQ_MULTIPLE: "",
}


def with_xcp_tables(page: str) -> str:
    """Return the page with its tables as the code has them."""
    return filled(page, (_records(), _commands()))


def _records() -> list[str]:
    rows = []
    for record in RECORDS:
        last, count = record.base + record.dtype.itemsize - 1, len(record.variables)
        rows.append((f"`{record.name}`", f"{record.base:05X}–{last:05X}", str(count), MEANINGS[record.name]))
    return ["## Addresses", "", *table("| group | addresses | variables | |", rows)]


def _commands() -> list[str]:
    lines = [
        "## Commands",
        "",
        f"MAX_CTO and MAX_DTO: {ETHERNET.command} and {ETHERNET.data} on UDP and TCP,"
        f" {CAN.command} and {CAN.data} on CAN.",
        "",
    ]
    rows = [(f"{one:02X}", one.name, _WHAT[one]) for one in Command]
    return [*lines, *table("| | command | |", rows)]
