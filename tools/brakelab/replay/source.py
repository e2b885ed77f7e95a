"""Meaning of a log's frames: the contract's database, or a signal map with a database of its own."""

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from brakelab.logs.formats import interface_name
from brakelab.replay.quality import Findings
from ecu.bus.receive import ReceivePlan, contract_receive_plan
from ecu.bus.signal_map import load_signal_map, read_signal_map
from ecu.contract.records import RecordArray
from ecu.settings.resources import resource


class Source(NamedTuple):
    """Meaning of a log's frames."""

    plan: ReceivePlan
    bus: str
    """The interface that counts in a log of several, empty: all."""
    database_hash: str
    """SHA-256 of the database, with a map of both."""


def load_source(map: Path | None) -> Source:
    """Return what a signal map says, None: the contract. Raises UserError for a map that is not right."""
    if map is None:
        database = resource("dbc/brake_ecu.dbc")
        return Source(contract_receive_plan(database), "", _hash(database))
    mapped = load_signal_map(map)
    database = map.parent / read_signal_map(map).database
    return Source(mapped.plan, mapped.bus or "", _hash(map, database))


def map_unused(map: Path, log: Path) -> str:
    """Return the line for a map that comes with a file of decoded signals."""
    return f"{map}: not used for {log}, whose signals are decoded already"


def _hash(*paths: Path) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def only_interface(blocks: Iterable[RecordArray], name: str, findings: Findings) -> Iterator[RecordArray]:
    """Keep the frames of one interface; a log of a single one is that bus, whatever its name.

    `name` may be the number of a channel: channel 1 is can0.
    """
    name = interface_name(int(name)) if name.isdecimal() else name
    for block in blocks:
        names = findings.interfaces
        if name in names:
            kept = block[block["bus"] == names.index(name)]
        else:
            kept = block if len(names) == 1 else block[:0]
        findings.other_interfaces += len(block) - len(kept)
        if len(kept):
            yield kept
