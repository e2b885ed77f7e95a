"""Meaning of a log's frames: the contract's database, or a signal map with a database of its own."""

import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from brakelab.logs.column_map import MappedFile, maps_columns, read_column_map
from brakelab.logs.formats import interface_name, kind_of
from brakelab.replay.quality import Findings
from ecu.bus.receive_plan import ReceivePlan, contract_receive_plan
from ecu.bus.signal_map import load_signal_map, read_signal_map
from ecu.contract.records import RecordArray
from ecu.contract.signals import VEHICLE_SPEED
from ecu.errors import UserError
from ecu.output import say
from ecu.settings.resources import resource

NEAR: Final = 0.02  # of a radius, that tyres and loads differ by


class Source(NamedTuple):
    """Meaning of a log's frames."""

    plan: ReceivePlan
    bus: str
    """The interface that counts in a log of several, empty: all."""
    database_hash: str
    """SHA-256 of the database, with a map of both; of a map of columns."""
    columns: MappedFile | None = None
    """Columns of a signal file, None: the contract's names and units."""
    rolling_radius: float | None = None
    """m, with which the map makes rotation of the wheels' speeds; None: they need none."""
    left_out: str = ""
    """Line on the mistakes in messages of the database that the map does not use."""


def load_source(map: Path | None) -> Source:
    """Return the source by a signal map, None: the contract. Raises UserError for a map that is not right."""
    if map is None:
        return _contract()
    if maps_columns(map):
        columns = read_column_map(map)
        return Source(_contract().plan, "", _hash(map), columns, columns.content.rolling_radius)
    mapped = load_signal_map(map)
    content = read_signal_map(map)
    database = map.parent / content.database
    radius = content.rolling_radius
    return Source(mapped.plan, mapped.bus or "", _hash(map, database), None, radius, mapped.left_out)


@cache
def _contract() -> Source:
    database = resource("dbc/brake_ecu.dbc")
    return Source(contract_receive_plan(database), "", _hash(database))


def announced(source: Source) -> Source:
    """Say what of the source's database is left out; return the source."""
    if source.left_out:
        say(source.left_out)
    return source


def check_map(map: Path, source: Source, log: Path) -> str:
    """Return a line for a map of frames that comes with a file of decoded signals, else nothing.

    Raises:
        UserError: a map of columns comes with a log of frames.
    """
    signals = kind_of(log) == "signals"
    if source.columns and not signals:
        raise UserError(
            str(map), "inputs", f"maps columns, but {log} holds frames; map messages of a database"
        )
    if signals and not source.columns:
        return f"{map}: not used for {log}, whose signals are decoded already; a map of columns would be"
    return ""


def radius_line(map: Path | None, source: Source, params: Any) -> str:
    """Return a line where the wheels of `params` (one `PARAMS`) do not roll as the map says, else nothing."""
    radius = float(params["wheel_radius"].mean())
    if map is None or source.rolling_radius is None or abs(source.rolling_radius / radius - 1.0) < NEAR:
        return ""
    off = 100.0 * (radius / source.rolling_radius - 1.0)
    reason = (
        f"the wheels of CONFIG roll on {radius:.4g} m, so that speeds are read {off:+.0f} % beside the log's"
    )
    return f"{map}: rolling_radius: {reason}; give {radius:.4g}, unless the log's speeds are wrong by as much"


def delay_line(source: Source, params: Any) -> str:
    """Return a line where both the map and the car of `params` (one `PARAMS`) have a lag of the speed."""
    delay = float(params["vehicle_speed_delay"])
    lag = source.columns.lags.get(VEHICLE_SPEED, 0.0) if source.columns else 0.0
    if not (lag and delay and source.columns):
        return ""
    reason = f"{lag:g} s beside {delay:g} s of CONFIG's sensors.vehicle_speed_delay; keep one of them"
    return f"{source.columns.path}: inputs.vehicle_speed.lag: {reason}"


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
