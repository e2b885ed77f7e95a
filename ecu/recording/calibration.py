"""Parameters that take the place of CONFIG's in a run: asked for through the ring, noted in a recording.

Another process writes a page of the ring and asks for it; the loop takes it over between two cycles, or
refuses it (`ecu/runtime/calibration.py`), and says in the ring's header which page it goes by, and since
which cycle. That page stays as it is until the next one is taken over. A recording has a line of JSON for
each, by which `replay` exchanges the parameters before the same cycle. With a page goes what a workshop does
to the learned values, once, as the page is taken over.
"""

import json
import os
import zlib
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from ecu.contract.records import RecordArray
from ecu.contract.work import Work, from_json, from_record, to_json, to_record
from ecu.recording.ring import PAGE, TABLES_BYTES, Ring

NOTES_FILE: Final = "calibrations.jsonl"
KEPT: Final = ("transmit", "fixed", "mapped")
"""Parameters of the run, not of CONFIG."""


class Note(NamedTuple):
    """A calibration that was taken over."""

    number: int
    """Of those of the run, from 1 on."""
    cycle: int
    """The first that goes by it."""
    tables: dict[str, Any]
    """The tables of CONFIG that it replaces, whole."""
    work: Work | None = None
    """What is done before that cycle, once."""


def check_of(ring: Ring, page: int) -> int:
    """Return the CRC-32 of a page: one that is written half is not taken over."""
    return zlib.crc32(ring.pages[page : page + 1].view(np.uint8).data)


def ask(
    ring: Ring, params: RecordArray, tables: dict[str, Any], until_ns: int, work: Work | None = None
) -> int:
    """Ask the loop of a `ring` that may be written for parameters; return the number that it will answer.

    Args:
        ring: of the loop.
        params: `PARAMS`, shape (1,).
        tables: of CONFIG, those that they may differ in.
        until_ns: refused later than that, on the monotonic clock.
        work: to be done as they are taken over.
    """
    text = json.dumps(tables).encode()
    if len(text) > TABLES_BYTES:
        raise ValueError(f"tables of {len(text)} bytes")
    header, asked = ring.header[0], ring.asked
    number = 1 + max(int(header["answered"]), int(asked["number"][0]))
    page = 1 - int(header["page"])
    content = np.zeros(1, PAGE)
    content["number"], content["params"], content["tables"] = header["calibration"] + 1, params, text
    content["work"] = to_record(work)
    ring.pages[page] = content[0]
    asked["page"], asked["until_ns"], asked["check"] = page, until_ns, check_of(ring, page)
    asked["number"] = number
    return number


def in_force(ring: Ring) -> Note | None:
    """Return the calibration that the loop goes by, None: it goes by CONFIG."""
    header = ring.header
    while number := int(header["calibration"][0]):
        page, cycle = ring.pages[int(header["page"][0])].copy(), int(header["calibrated_from"][0])
        if page["number"] == number:  # else another one is being taken over
            return Note(number, cycle, json.loads(bytes(page["tables"])), from_record(page["work"]))
    return None


def add_note(folder: Path, note: Note) -> None:
    """Add a line to the notes of a recording. Raises OSError."""
    line = {**note._asdict(), "work": note.work and to_json(note.work)}
    with (folder / NOTES_FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
        file.flush()
        os.fsync(file.fileno())


def read_notes(folder: Path) -> list[Note]:
    """Return the calibrations of a recording, in order.

    Raises:
        OSError, LookupError, TypeError, ValueError: they cannot be read.
    """
    path = folder / NOTES_FILE
    if not path.exists():
        return []
    lines = path.read_text(encoding="utf-8").splitlines()
    found = [json.loads(line) for line in lines]
    return [
        Note(int(one["number"]), int(one["cycle"]), dict(one["tables"]), from_json(one.get("work")))
        for one in found
    ]
