"""Databases (DBC, KCD, SYM, ARXML), loaded and checked by cantools; errors are one line: place and remedy."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, Final

import cantools
from cantools.database import Database, Message

from ecu.bus.bits import first_bit
from ecu.errors import UserError, closest

LONGEST_PAYLOAD: Final = 64  # bytes, CAN FD
SHOWN: Final = 6  # suggested names
KINDS: Final = ".dbc, .arxml, .kcd, .sym"
BEGINNING: Final = {"0", "7"}  # start position of a PDU that begins with its frame, little- and big-endian

_SYNTAX = re.compile(r'Invalid syntax at line (\d+), column (\d+): "(.*?)"{1,2}$', re.DOTALL)
_OVERLAP = re.compile(r"The signals (\S+) and (\S+) are overlapping in message (\S+?)\.?\"?$")
_OUTSIDE = re.compile(r"The signal (\S+) does not fit in message (\S+?)\.?\"?$")
_XML = re.compile(r"([a-z (),-]+): line (\d+), column (\d+)\W*$")


def _refusal(path: Path, error: Exception) -> UserError:
    text = str(error)
    if found := _SYNTAX.search(text):
        line, column, source = found.groups()
        around = source.partition(">>!<<")
        near = f"{around[0][-20:]}»{around[2][:30]}".strip()
        remedy = f"syntax not understood at » in: {near}; mend that line"
        return UserError(str(path), f"line {line}, column {column}", remedy)
    if found := _OVERLAP.search(text):
        first, second, message = found.groups()
        remedy = f"overlaps {second}; if that is meant, set strict = false in the map"
        return UserError(str(path), f"{message}.{first}", remedy)
    if found := _OUTSIDE.search(text):
        signal, message = found.groups()
        remedy = "does not fit its message; if it is not used, set strict = false in the map"
        return UserError(str(path), f"{message}.{signal}", remedy)
    if found := _XML.search(text):
        what, line, column = found.groups()
        remedy = f"no XML from there on ({what.strip()}); the file is cut off or damaged, export it again"
        return UserError(str(path), f"line {line}, column {column}", remedy)
    if text.startswith("expected database format"):
        return UserError(str(path), "", f"no database by its name; let it end as its content is ({KINDS})")
    if "NoneType" in text:  # of AUTOSAR's elements, which cantools takes for granted
        text = (
            "an element that describes messages is missing; export a system description with its CAN cluster"
        )
    reason = " ".join(text.split()) or type(error).__name__
    return UserError(str(path), "", f"not a database that can be read ({reason})")


def load_database(path: Path, strict: bool = True) -> Database:
    """Return the database at `path`; `strict` refuses overlapping and misplaced signals.

    Raises UserError naming line and column, or message and signal.
    """
    if not path.is_file():
        raise UserError(str(path), "", f"no such file; give the path of a database ({KINDS})")
    if path.stat().st_size == 0:
        raise UserError(str(path), "", f"the file is empty; give a database ({KINDS})")
    try:
        database = cantools.database.load_file(path, strict=strict)
    except Exception as error:  # cantools' parsers raise errors of many kinds
        raise _refusal(path, error) from None
    if not isinstance(database, Database):
        raise UserError(str(path), "", "a diagnostics database; give one that describes CAN messages")
    if not database.messages:
        where = "no CAN cluster with a frame" if path.suffix.lower() == ".arxml" else "no message"
        raise UserError(str(path), "", f"{where} in it; give the database of a CAN bus")
    if path.suffix.lower() == ".arxml":
        _check_pdus(path)
    return database


def _check_pdus(path: Path) -> None:
    """Refuse frames whose PDU does not begin with them: cantools would read it from the first byte."""
    for frame in ET.parse(path).iterfind(".//{*}CAN-FRAME"):
        for start in frame.iterfind(".//{*}PDU-TO-FRAME-MAPPING/{*}START-POSITION"):
            if (start.text or "").strip() not in BEGINNING:
                remedy = f"its PDU begins at bit {start.text}, which is not read; give a database as DBC"
                raise UserError(str(path), frame.findtext("{*}SHORT-NAME", ""), remedy)


def attribute(message: Message, name: str, default: int = 0) -> int:
    """Return an integer message attribute of a DBC, else its default there, else `default`."""
    specifics = message.dbc
    if specifics is not None and name in specifics.attributes:
        return int(specifics.attributes[name].value)
    return default


def find_message(database: Database, name: str, where: Path, key: str) -> Message:
    """Return the message `name` requested by `key` of the file `where`; raises UserError if there is none."""
    try:
        return database.get_message_by_name(name)
    except KeyError:
        names = [message.name for message in database.messages]
        remedy = f"the database has no message {name}{_choice(name, names)}"
        raise UserError(str(where), key, remedy) from None


def find_signal(message: Message, name: str, path: Path, where: Path, key: str) -> Any:
    """Return the signal `name` of the message, as requested by `key` of the file `where`.

    Raises UserError when there is none, or none that can be read (`path` is the database's).
    """
    for signal in message.signals:
        if signal.name == name:
            if not fits(signal, message.length) or not signal.scale:
                remedy = f"start bit, length or scale is wrong for {message.length} bytes; mend it"
                raise UserError(str(path), f"{message.name}.{name}", remedy)
            if signal.multiplexer_signal is not None:
                find_signal(message, signal.multiplexer_signal, path, where, key)
            return signal
    names = [signal.name for signal in message.signals]
    remedy = f"message {message.name} has no signal {name}{_choice(name, names)}"
    raise UserError(str(where), key, remedy)


def fits(signal: Any, length: int) -> bool:
    """Return whether the signal lies within a valid frame payload of `length` bytes."""
    start = first_bit(signal.start, signal.byte_order == "big_endian")
    return length <= LONGEST_PAYLOAD and bool(start + signal.length <= 8 * length)


def _choice(name: str, names: list[str]) -> str:
    """Return the name probably meant, or the available ones."""
    if not names:
        return "; it has none that can be read (containers of AUTOSAR are not)"
    more = f", … ({len(names)} in all)" if len(names) > SHOWN else ""
    return closest(name, names) or f"; it has {', '.join(sorted(names)[:SHOWN])}{more}"
