"""Mistakes of a database: every one at once, with its line in a DBC, and the message that it spoils.

cantools reads; what stops it (syntax in a signal or a comment, a signal without bits) is blanked out, noted,
and the rest read again. Overlaps, bits beyond a message and names given twice are found on cantools' objects.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import cantools
from cantools.database import Database, Message

from ecu.bus.bits import first_bit

MOST_BLANKED: Final = 40  # pieces that are blanked out before the file is given up

_SYNTAX: Final = re.compile(r'Invalid syntax at line (\d+), column (\d+): "(.*?)"{1,2}$', re.DOTALL)
_EMPTY: Final = re.compile(r"The signal (\S+) length (-?\d+) is not greater than 0 in message (\S+?)\.?\"?$")
_MESSAGE: Final = re.compile(r"\s*BO_\s+\d+\s+(\w+)\s*:")
_SIGNAL: Final = re.compile(r"\s*SG_\s+(\w+)\b")
_COMMENT: Final = re.compile(r'\s*CM_\b[^"\n]*"[^"]*"\s*;')


class Mistake(NamedTuple):
    """One thing that is wrong in a database."""

    message: str
    """That it spoils; empty: none, as a comment does not."""
    place: str
    remedy: str
    tolerable: bool = False
    """Whether `strict = false` takes the message all the same."""


class SyntaxFault(NamedTuple):
    """Where a parser of cantools stopped."""

    line: int
    place: str
    remedy: str


def syntax_fault(text: str) -> SyntaxFault | None:
    """Return where the parser stopped whose error says `text`; None: it is about something else."""
    if not (found := _SYNTAX.search(text)):
        return None
    before, _, after = found[3].partition(">>!<<")
    near = f"{before[-20:]}»{after[:30]}".strip()
    return SyntaxFault(
        int(found[1]), f"line {found[1]}, column {found[2]}", f"syntax not understood at » in: {near}"
    )


def parse(path: Path, mistakes: list[Mistake]) -> Any:
    """Return the database at `path` as cantools reads it; every mistake in it is added to `mistakes`.

    Raises cantools' errors for a file that it cannot read, after those that it got past.
    """
    lines: list[str] = []
    if path.suffix.lower() == ".dbc":
        lines = _text(path.read_bytes()).replace("\r\n", "\n").split("\n")
        database = _parse_dbc(list(lines), mistakes)
    else:
        database = cantools.database.load_file(path, strict=False)
    if isinstance(database, Database):
        mistakes += _layout_mistakes(database, _Places(lines))
    return database


def _text(content: bytes) -> str:
    """Return the text of a DBC: UTF-8 if it is that, else what Vector's editors write."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _parse_dbc(lines: list[str], mistakes: list[Mistake]) -> Any:
    """Read the lines of a DBC; those of signals and comments that are not understood are blanked out."""
    while True:
        try:
            return cantools.database.load_string("\n".join(lines), "dbc", strict=False)
        except Exception as error:  # cantools' parsers raise errors of many kinds
            mistake = _blank_out(lines, str(error)) if len(mistakes) < MOST_BLANKED else None
            if mistake is None:
                raise
            mistakes.append(mistake)


def _blank_out(lines: list[str], text: str) -> Mistake | None:
    """Blank out what an error is about, and return the mistake; None: it is about something else."""
    if found := _EMPTY.search(text):
        signal, length, message = found.groups()
        row = _Places(lines).row(message, signal)
        if row is None:
            return None
        lines[row] = ""
        remedy = f"has {length} bits; give its length, or remove it"
        return Mistake(message, f"line {row + 1}, {message}.{signal}", remedy)
    if not (fault := syntax_fault(text)):
        return None
    row = fault.line - 1
    if _SIGNAL.match(lines[row]):
        owner = next((m for line in reversed(lines[:row]) if (m := _MESSAGE.match(line))), None)
        lines[row] = ""
        return Mistake(owner[1], fault.place, f"{fault.remedy}; mend that line") if owner else None
    whole = _COMMENT.match("\n".join(lines[row:]))
    if whole or (lines[row].lstrip().startswith("CM_") and lines[row].rstrip().endswith(";")):
        count = 1 + (whole[0].count("\n") if whole else 0)
        lines[row : row + count] = [""] * count
        return Mistake("", fault.place, f"{fault.remedy}; mend that comment")
    return None


class _Places:
    """Rows of a DBC where messages and signals are defined; of other files none."""

    def __init__(self, lines: list[str]) -> None:
        self._messages: dict[str, list[int]] = {}
        self._signals: dict[tuple[str, int, str], list[int]] = {}
        owner = ("", 0)
        for row, line in enumerate(lines):
            if found := _MESSAGE.match(line):
                rows = self._messages.setdefault(found[1], [])
                owner = (found[1], len(rows))
                rows.append(row)
            elif found := _SIGNAL.match(line):
                self._signals.setdefault((*owner, found[1]), []).append(row)

    def row(self, message: str, signal: str = "", definition: int = 0, which: int = 0) -> int | None:
        """Return the row of a message, or of one of its signals, of its `definition` in the file."""
        found = self._signals.get((message, definition, signal)) if signal else self._messages.get(message)
        place = which if signal else definition
        return found[place] if found and place < len(found) else None

    def name(self, message: str, signal: str = "", definition: int = 0, which: int = 0) -> str:
        """Return the place as a user finds it."""
        row = self.row(message, signal, definition, which)
        name = f"{message}.{signal}" if signal else message
        return name if row is None else f"line {row + 1}, {name}"


def _layout_mistakes(database: Database, places: _Places) -> list[Mistake]:
    mistakes = []
    seen: dict[str, int] = {}
    for message in database.messages:
        definition = seen.get(message.name, 0)
        seen[message.name] = definition + 1
        if definition:
            remedy = "this message is defined twice; remove one, or give it another name"
            mistakes.append(Mistake(message.name, places.name(message.name, "", definition), remedy))
        names: dict[str, int] = {}
        for signal in message.signals:
            which = names[signal.name] = names.get(signal.name, -1) + 1
            if which:
                place = places.name(message.name, signal.name, definition, which)
                remedy = "its message has two signals of this name; rename one"
                mistakes.append(Mistake(message.name, place, remedy))
        try:
            message.refresh(strict=True)
        except Exception as error:  # cantools has an error of its own for each of these
            found = [
                Mistake(message.name, places.name(message.name, signal, definition), remedy, tolerable=True)
                for signal, remedy in _bits_mistakes(message)
            ]
            said = Mistake(message.name, places.name(message.name, "", definition), str(error), True)
            mistakes += found or [said]
            message.refresh(strict=False)
    return mistakes


def _bits_mistakes(message: Message) -> Iterator[tuple[str, str]]:
    """Yield each signal that lies beyond its message or on another one, and the remedy."""
    taken: list[tuple[Any, set[int], dict[str, set[int]]]] = []
    for signal in message.signals:
        first = first_bit(signal.start, signal.byte_order == "big_endian")
        if first + signal.length > 8 * message.length:
            yield (
                signal.name,
                f"does not fit its message of {message.length} bytes; mend start bit or length, or "
                "set strict = false in the map, if it is not used",
            )
            continue
        bits, selected = _bits(signal), _selection(message, signal)
        others = [
            other.name
            for other, its_bits, its_selection in taken
            if bits & its_bits and _together(selected, its_selection)
        ]
        if others:
            yield (
                signal.name,
                f"overlaps {', '.join(others)}; if that is meant, set strict = false in the map",
            )
        taken.append((signal, bits, selected))


def _bits(signal: Any) -> set[int]:
    """Return the bits of a signal, numbered as by a DBC: bit 0 is the lowest of byte 0."""
    if signal.byte_order != "big_endian":
        return set(range(signal.start, signal.start + signal.length))
    first = first_bit(signal.start, True)
    return {8 * (bit // 8) + 7 - bit % 8 for bit in range(first, first + signal.length)}


def _selection(message: Message, signal: Any) -> dict[str, set[int]]:
    """Return the codes of each multiplexer with which a signal is in the frame."""
    signals = {one.name: one for one in message.signals}
    found: dict[str, set[int]] = {}
    while signal is not None and signal.multiplexer_signal is not None and len(found) < len(signals):
        found[signal.multiplexer_signal] = set(signal.multiplexer_ids or ())
        signal = signals.get(signal.multiplexer_signal)
    return found


def _together(one: dict[str, set[int]], other: dict[str, set[int]]) -> bool:
    """Return whether two signals can be in the same frame."""
    return all(one[name] & other[name] for name in one.keys() & other.keys())
