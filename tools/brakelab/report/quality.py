"""Contents of the logs behind a result and speed of their replay, from the result's metadata."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from brakelab.report.drive import DriveResult
from brakelab.report.page import Tile, fixed
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

PERIOD: Final = 0.01  # s, one row
RATE_OFF: Final = 0.1
"""Share by which a rate may miss the expected one before it is marked."""
LONG: Final = 60_000
"""Rows from which on a replay's speed is not that of its start."""
_DAMAGE: Final = {
    "damaged": "pieces damaged",
    "damaged_lines": "lines damaged",
    "stamps_backwards": "steps back in time",
    "clock_set": "times the clock was set",
    "rows_twice": "rows twice",
    "frames_twice": "frames twice",
    "gaps": "gaps of more than a second",
    "dropped": "frames dropped by the kernel",
}
_MESSAGE: Final = ("checksum_errors", "sequence_errors", "repeated", "length_errors", "lost")


class Cell(NamedTuple):
    """A place of a table; `warns`: it needs attention."""

    text: str
    warns: bool = False


class Log(NamedTuple):
    """One log of the drive."""

    name: str
    rows: int
    samples: int
    seconds: float
    """That its replay took, NaN: not known."""
    found: str
    """Damage, empty if none."""


class Quality(NamedTuple):
    """Quality of a result's inputs."""

    logs: list[Log]
    inputs: list[tuple[str, list[Cell]]]
    """By name: rate, expected, longest gap, invalid, outside, clipped, jumps, least, greatest, unit."""
    messages: list[tuple[str, list[Cell]]]
    """By name: identifier, received, rate, expected, then the counters of `_MESSAGE`."""
    silent: list[str]
    """Inputs that could have come and never did."""


def read_quality(drive: DriveResult, path: Path) -> Quality | None:
    """Return the quality stored by `replay` in the metadata of `path`, None: nothing.

    Raises UserError if it is damaged.
    """
    try:
        counts = json.loads(drive.metadata.get("quality", "[]"))
        names = [source["name"] for source in json.loads(drive.metadata.get("inputs", "[]"))]
        if not counts:
            return None
        seconds = PERIOD * sum(log["rows"] for log in counts)
        inputs = _together(counts, "inputs")
        silent = [row["name"] for row in inputs if not row["samples"]]
        return Quality(
            [_log(log, name) for log, name in zip(counts, names, strict=True)],
            [(row["name"], _input(row, seconds)) for row in inputs if row["samples"]],
            [
                (row["name"], _message(row, seconds))
                for row in _together(counts, "messages")
                if row["received"]
            ],
            silent,
        )
    except (ValueError, KeyError, TypeError) as error:
        remedy = "write the result again with `brake-ecu replay`"
        raise UserError(str(path), "metadata quality", f"not readable ({error!r}); {remedy}") from None


def quality_tiles(quality: Quality) -> list[Tile]:
    """Return tiles with the number of marked inputs or messages, and the speed of the replay."""
    table = [*quality.inputs, *quality.messages]
    marked = [name for name, cells in table if any(cell.warns for cell in cells)]
    damaged = [log for log in quality.logs if log.found]
    note = ", ".join([*marked[:2], *(["…"] if len(marked) > 2 else [])])
    if damaged:
        note = f"{damaged[0].found}{'; ' if note else ''}{note}"
    tiles = []
    if table:
        count = f"of {len(quality.inputs)} inputs, {len(quality.messages)} messages"
        warns = bool(marked or damaged)
        tiles.append(Tile("Data marked", f"{len(marked)}", "", note or f"none {count}", warns))
    took = sum(log.seconds for log in quality.logs)
    rows = sum(log.rows for log in quality.logs)
    if rows >= LONG and took > 0.0:
        note = f"{rows} rows in {fixed(took, 1)} s: {rows / took:.0f} rows/s"
        tiles.append(Tile("Replayed", f"{PERIOD * rows / took:.0f}", "× real time", note))
    return tiles


def _log(counts: dict[str, Any], name: str) -> Log:
    found = [f"{counts[key]} {text}" for key, text in _DAMAGE.items() if counts.get(key)]
    samples = int(counts.get("frames", 0)) + int(counts["samples"])
    return Log(name, counts["rows"], samples, counts.get("seconds", float("nan")), ", ".join(found))


def _together(counts: Sequence[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    """Return the rows of all logs by name: counters summed, gaps and extremes the largest."""
    farthest = {"greatest_gap_s": max, "least": min, "greatest": max}
    rows: dict[str, dict[str, Any]] = {}
    for log in counts:
        for row in log.get(kind, []):
            known = rows.setdefault(row["name"], {**row, **{key: 0 for key in row if _counter(row, key)}})
            for key, value in row.items():
                if key in farthest:
                    known[key] = farthest[key](
                        (v for v in (known[key], value) if v is not None), default=None
                    )
                elif _counter(row, key):
                    known[key] += value
    return list(rows.values())


def _counter(row: dict[str, Any], key: str) -> bool:
    return isinstance(row[key], int)


def _input(row: dict[str, Any], seconds: float) -> list[Cell]:
    rate = row["samples"] / seconds
    expected = row["expected_hz"]
    off = bool(expected) and not (
        (1.0 - RATE_OFF) * expected[0] - 1.0 / seconds <= rate <= (1.0 + RATE_OFF) * expected[1]
    )
    shares = [100.0 * row[kind] / row["samples"] for kind in ("invalid", "outside")]
    return [
        Cell(fixed(rate, 1), off),
        Cell("–".join(dict.fromkeys(f"{hertz:.3g}" for hertz in expected)) or "any"),
        Cell(fixed(row["greatest_gap_s"], 2), row["greatest_gap_s"] > row["timeout_s"]),
        *(Cell(fixed(share, 2) if share else "0", share > 0.0) for share in shares),
        *(Cell(f"{row[kind]}", row[kind] > 0) for kind in ("clipped", "jumps")),
        *(Cell(_digits(row[end])) for end in ("least", "greatest")),
        Cell(row["unit"].replace("^2", "²").replace("degC", "°C")),
    ]


def _digits(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


def _message(row: dict[str, Any], seconds: float) -> list[Cell]:
    rate, expected = row["received"] / seconds, row["expected_hz"]
    return [
        Cell(row["id"]),
        Cell(f"{row['received']}"),
        Cell(fixed(rate, 1)),
        Cell(f"{expected:.3g}" if expected else "any"),
        *(Cell(f"{row[kind]}", row[kind] > 0) for kind in _MESSAGE),
    ]


def lacks_pressure(drive: DriveResult, quality: Quality | None) -> bool:
    """Return whether the logs are known to hold no calliper pressure: then no friction was estimated."""
    pressure = drive.column("calliper_pressure_fl")
    if quality is None or not (pressure == 0.0).all():
        return False
    came = {name for name, _ in quality.inputs} - set(quality.silent)
    return not any(name.startswith("calliper_pressure") for name in came)


def drop_placeholders(drive: DriveResult, without_pressure: bool) -> DriveResult:
    """Return the drive without the columns that hold placeholders.

    Friction without a pressure is the configured one, a demand that nobody made is zero.
    """
    nothing = ["mu_b", "sigma_mu_b", "calliper_pressure", "brake_torque"] if without_pressure else []
    nothing += [] if drive.has("decel_demand_total") else ["pressure_demand"]
    return drive.without({f"{stem}_{corner}" for stem in nothing for corner in CORNERS})
