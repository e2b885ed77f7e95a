"""Databases (DBC, KCD, SYM, ARXML), loaded and checked by cantools; errors are one line: place and remedy."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final, NamedTuple

from cantools.database import Database, Message

from ecu.bus.bits import first_bit
from ecu.bus.database_mistakes import Mistake, parse, syntax_fault
from ecu.errors import Mistakes, UserError, closest

LONGEST_PAYLOAD: Final = 64  # bytes, CAN FD
ANYBODY: Final = 0xFE
"""J1939's null address, as source in a database."""
SHOWN: Final = 6  # suggested names
KINDS: Final = ".dbc, .arxml, .kcd, .sym"
BEGINNING: Final = {"0", "7"}  # start position of a PDU that begins with its frame, little- and big-endian

_XML = re.compile(r"([a-z (),-]+): line (\d+), column (\d+)\W*$")


def _refusal(path: Path, error: Exception) -> UserError:
    text = str(error)
    if fault := syntax_fault(text):
        return UserError(str(path), fault.place, f"{fault.remedy}; mend that line")
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


class Readable(NamedTuple):
    """A database, as far as it can be read."""

    database: Database
    mistakes: list[Mistake]

    def refuse(self, path: Path, strict: bool, used: Collection[str] | None = None) -> None:
        """Raise every mistake that spoils one of the messages `used`, None: any of the database.

        `strict` refuses overlapping and misplaced signals too.
        """
        findings = [
            (mistake.place, mistake.remedy)
            for mistake in self.mistakes
            if (strict or not mistake.tolerable)
            and (used is None or mistake.message in used)
            and mistake.message
        ]
        if findings:
            raise Mistakes(str(path), findings)

    def left_out(self, path: Path, used: Collection[str]) -> str:
        """Return a line on the mistakes elsewhere than in the messages `used`, empty: there are none."""
        others = [mistake for mistake in self.mistakes if mistake.message not in used]
        if not others:
            return ""
        first = f"{others[0].place}: {others[0].remedy.partition(';')[0]}"
        spoilt = dict.fromkeys(mistake.message for mistake in others if mistake.message)
        omitted = (
            f"{len(spoilt)} message{'s' if len(spoilt) > 1 else ''} left out, which the map does not use"
        )
        more = f" (and {len(others) - 1} more)" if len(others) > 1 else ""
        return f"{path}: {first}{more}; {omitted if spoilt else 'only a comment is lost'}"


def load_database(path: Path, strict: bool = True) -> Database:
    """Return the database at `path`; `strict` refuses overlapping and misplaced signals.

    Raises UserError naming line and column, or message and signal, of every mistake at once.
    """
    readable = read_database(path)
    readable.refuse(path, strict)
    return readable.database


def read_database(path: Path) -> Readable:
    """Return the database at `path` and its mistakes. Raises UserError for a file that cannot be read."""
    if not path.is_file():
        raise UserError(str(path), "", f"no such file; give the path of a database ({KINDS})")
    if path.stat().st_size == 0:
        raise UserError(str(path), "", f"the file is empty; give a database ({KINDS})")
    mistakes: list[Mistake] = []
    try:
        database = parse(path, mistakes)
    except Exception as error:  # cantools' parsers raise errors of many kinds
        last = _refusal(path, error)
        before = [(mistake.place, mistake.remedy) for mistake in mistakes]
        raise Mistakes(str(path), [*before, (last.place, last.remedy)]) from None
    if not isinstance(database, Database):
        raise UserError(str(path), "", "a diagnostics database; give one that describes CAN messages")
    if not database.messages:
        where = "no CAN cluster with a frame" if path.suffix.lower() == ".arxml" else "no message"
        raise UserError(str(path), "", f"{where} in it; give the database of a CAN bus")
    if path.suffix.lower() == ".arxml":
        _check_pdus(path)
    return Readable(database, mistakes)


def _check_pdus(path: Path) -> None:
    """Refuse frames whose PDU does not begin with them: cantools would read it from the first byte."""
    for frame in ET.parse(path).iterfind(".//{*}CAN-FRAME"):
        for start in frame.iterfind(".//{*}PDU-TO-FRAME-MAPPING/{*}START-POSITION"):
            if (start.text or "").strip() not in BEGINNING:
                remedy = f"its PDU begins at bit {start.text}, which is not read; give a database as DBC"
                raise UserError(str(path), frame.findtext("{*}SHORT-NAME", ""), remedy)


def attribute(message: Message, name: str) -> int:
    """Return an integer message attribute of a DBC, else its default there, else 0."""
    specifics = message.dbc
    if specifics is not None and name in specifics.attributes:
        return int(specifics.attributes[name].value)
    return 0


def find_message(database: Database, name: str, where: Path, key: str) -> Message:
    """Return the message `name` requested by `key` of the file `where`; raises UserError if there is none."""
    try:
        return database.get_message_by_name(name)
    except KeyError:
        names = [message.name for message in database.messages]
        remedy = f"the database has no message {name}{_choice(name, names)}"
        raise UserError(str(where), key, remedy) from None


def set_sender(
    message: Message, source: int | None, priority: int | str | None, where: Path, key: str
) -> None:
    """Give a J1939 message the source address and priority of `key` of the file `where`, where there are any.

    Any priority (a word) is 0.

    Raises:
        UserError: an identifier of 11 bits, or a J1939 message that nobody in particular sends.
    """
    anybody = message.protocol == "j1939" and message.frame_id & 0xFF == ANYBODY
    if source is None and anybody:
        remedy = "missing, and the database leaves the sender open (FE); give its address"
        raise UserError(str(where), f"{key}.source", remedy)
    if (source, priority) != (None, None) and not message.is_extended_frame:
        remedy = f"source and priority are of 29 bits (J1939), {message.name} has 11; remove them"
        raise UserError(str(where), key, remedy)
    if source is not None:
        message.frame_id = message.frame_id & ~0xFF | source
    if priority is not None:
        bits = priority if isinstance(priority, int) else 0
        message.frame_id = message.frame_id & ~(7 << 26) | bits << 26


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
