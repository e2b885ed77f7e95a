"""Drives of a fleet, by a pattern of file names or by a manifest.

```
vehicle,log,time,config,map,pads             # CSV; time, config, map and pads may be missing or empty
car-7,2026/0001.log,2026-05-01T08:00:00Z,suv,
car-7,2026/0002a.log;2026/0002b.log,2026-05-01T17:30:00Z,suv,        # two logs of one drive
```
```
[[vehicle]]                                  # TOML
name = "car-7"
config = "suv"                               # default: that of the command line
map = "kona"
drives = ["2026/0001.log", ["2026/0002a.log", "2026/0002b.log"]]     # in the order of driving
```
Logs and files of configurations are named relative to the manifest, or as addresses. In a CSV the drives of a
vehicle are in the order of `time` (ISO 8601 or a number); without times, in that of the rows. `pads`: done
to the pads before the drive: `new`, `front` or `rear` (fitted), or a lining measured, `fl=9.8;fr=9.7` [mm].
"""

import csv
import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Final, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brakelab.fleet.files import expand
from ecu.errors import UserError
from ecu.pads import parse_measured
from ecu.settings.resources import named
from ecu.settings.toml_file import describe, read_toml

COLUMNS: Final = ("vehicle", "log", "time", "config", "map", "pads")
FITTED: Final = {"new": ("front", "rear"), "front": ("front",), "rear": ("rear",)}
"""Axles that got new pads, by the word in the column `pads`."""


class VehicleDrive(NamedTuple):
    """One drive of one vehicle."""

    vehicle: str
    name: str
    """Of its first log; no other drive of the vehicle has it."""
    logs: tuple[str, ...]
    """Paths or addresses of one drive, in order."""
    config: Path
    map: Path | None
    pads: str = ""
    """A key of `FITTED`, or measured linings as `ecu.pads.parse_measured` takes them; empty: nothing done."""


class _Vehicle(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: Annotated[str, Field(min_length=1)]
    config: str | None = None
    map: str | None = None
    drives: Annotated[list[str | list[str]], Field(min_length=1)]


class _Manifest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    vehicle: Annotated[list[_Vehicle], Field(min_length=1)]


def find_drives(given: Sequence[str], config: Path | None, map: Path | None, out: Path) -> list[VehicleDrive]:
    """Return the drives selected on the command line, those of a vehicle in order.

    `given` is one manifest, or patterns and names of logs: then the vehicle is the parent folder's name, and
    names are in natural order. Files in `out` are not logs.

    Raises:
        UserError: a manifest is invalid, nothing is found, or a drive has no configuration.
    """
    if len(given) == 1 and Path(given[0]).suffix.lower() == ".toml":
        drives = _from_toml(Path(given[0]), config, map)
    elif len(given) == 1 and Path(given[0]).suffix.lower() == ".csv" and not re.search(r"[*?\[]", given[0]):
        drives = _from_csv(Path(given[0]), config, map)
    else:
        drives = _from_patterns(given, config, map, out)
    seen: dict[tuple[str, str], VehicleDrive] = {}
    for drive in drives:
        other = seen.setdefault((drive.vehicle, drive.name), drive)
        if other is not drive:
            where = f"{other.logs[0]} and {drive.logs[0]}"
            remedy = f"two drives of vehicle {drive.vehicle} have this name; give another name to one of them"
            raise UserError(where, drive.name, remedy)
    return drives


def _from_patterns(
    given: Sequence[str], config: Path | None, map: Path | None, out: Path
) -> list[VehicleDrive]:
    own = str(out.resolve()) + "/"
    logs = [log for pattern in given for log in expand(pattern) if not log.startswith(own)]
    if not logs:
        raise UserError(
            " ".join(given), "", 'no log has such a name; give a pattern in quotes, "data/*/*.log"'
        )
    return [_drive(log.rstrip("/").split("/")[-2], (log,), config, map, "--config") for log in logs]


def _drive(
    vehicle: str, logs: Iterable[str], config: Path | None, map: Path | None, where: str
) -> VehicleDrive:
    if config is None:
        raise UserError(where, "", f"vehicle {vehicle} has no configuration; give --config CONFIG")
    logs = tuple(logs)
    return VehicleDrive(vehicle, logs[0].rstrip("/").rpartition("/")[2], logs, config, map)


def _beside(manifest: Path, name: str) -> str:
    return name if "://" in name or Path(name).is_absolute() else str(manifest.absolute().parent / name)


def _setting(manifest: Path, name: str | None, folder: str, default: Path | None) -> Path | None:
    """Return the file that a manifest names: beside it, or a shipped one."""
    if not name:
        return default
    beside = manifest.parent / name
    return beside if beside.is_file() else named(name, folder)


def _from_toml(path: Path, config: Path | None, map: Path | None) -> list[VehicleDrive]:
    try:
        manifest = _Manifest.model_validate(read_toml(path))
    except ValidationError as error:
        raise describe(error, str(path), _Manifest) from None
    drives = []
    for vehicle in manifest.vehicle:
        own = _setting(path, vehicle.config, "config", config)
        mapped = _setting(path, vehicle.map, "config/maps", map)
        for logs in vehicle.drives:
            named_logs = [_beside(path, log) for log in ([logs] if isinstance(logs, str) else logs)]
            if not named_logs:
                raise UserError(str(path), f"vehicle {vehicle.name}", "a drive without a log; name its logs")
            drives.append(_drive(vehicle.name, named_logs, own, mapped, str(path)))
    return drives


def _from_csv(path: Path, config: Path | None, map: Path | None) -> list[VehicleDrive]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream)
            missing = [name for name in COLUMNS[:2] if name not in (reader.fieldnames or ())]
            if missing:
                remedy = f"column {missing[0]} is missing; a manifest has vehicle,log[,time,config,map,pads]"
                raise UserError(str(path), "line 1", remedy)
            rows = [(reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(str(path), "", f"cannot be read ({error}); give a manifest as CSV or TOML") from None
    timed = []
    for line, row in rows:
        place = f"line {line}"
        logs = [_beside(path, log.strip()) for log in (row["log"] or "").split(";") if log.strip()]
        if not row["vehicle"] or not logs:
            raise UserError(str(path), place, "vehicle or log is missing; fill both cells")
        own = _setting(path, row.get("config"), "config", config)
        mapped = _setting(path, row.get("map"), "config/maps", map)
        drive = _drive(row["vehicle"], logs, own, mapped, f"{path}: {place}")
        drive = drive._replace(pads=_pads(path, place, row.get("pads")))
        timed.append((_instant(path, place, row.get("time")), drive))
    if not timed:
        raise UserError(str(path), "line 2", "no drive; give a row for each")
    return [drive for _, drive in sorted(timed, key=lambda row: row[0])]


def _pads(path: Path, place: str, text: str | None) -> str:
    text = (text or "").strip().replace(";", ",")
    if text and text not in FITTED:
        try:
            parse_measured(text)
        except UserError:
            remedy = f"{text!r} is none of {', '.join(FITTED)}, nor a measured lining in mm as fl=9.8;fr=9.7"
            raise UserError(str(path), f"{place}, pads", remedy) from None
    return text


def _instant(path: Path, place: str, text: str | None) -> float:
    if not text:
        return 0.0
    try:
        return float(text)
    except ValueError:
        pass
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        remedy = f"{text!r} is no time; write it as 2026-05-01T08:00:00Z, or a number"
        raise UserError(str(path), f"{place}, time", remedy) from None
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
