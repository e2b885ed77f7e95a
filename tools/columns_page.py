"""Text of docs/reference-columns.md: columns of results, by the tables of signals and brake applications."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from brakelab.results.brakes import BRAKE_UNITS, BrakeRow
from brakelab.results.files import MEASURED
from ecu.contract.signals import CORNERS, OUTPUT_SIGNALS, column_names, topic_of, without_corner
from ecu.settings.described import texts_below_keys
from page_tables import table

PAGE: Final = Path(__file__).parent.parent / "docs" / "reference-columns.md"
HEAD: Final = """# Columns of results

Written by `python tools/write_reference.py` from the tables of signals and of brake applications.

Names and units are the same in Parquet, MDF4, MCAP and [Python](python.md); what is sent has them
[on the bus](contract.md), too. `_*` stands for `_fl`, `_fr`, `_rl` and `_rr`; a column without it is the
car's. What is not available is null. Topics are those of MCAP and of [live Foxglove](watch.md#in-foxglove),
where a wheel's names have no ending.
"""


def _rows() -> Iterable[tuple[str, ...]]:
    yield "`t`", "s", "time, of the log or from its first frame", "`/ecu`"
    for signal in OUTPUT_SIGNALS:
        column = column_names(signal)[0]
        yield _named(column, signal.unit, signal.meaning)
    for one in MEASURED:
        if without_corner(one.name) == one.name or one.name.endswith(f"_{CORNERS[0]}"):
            yield _named(one.name, one.unit, "input, as last received")


def _named(column: str, unit: str, meaning: str) -> tuple[str, ...]:
    stem = without_corner(column)
    shown = stem if stem == column else f"{stem}_*"
    return f"`{shown}`", unit, meaning, f"`{topic_of(column)[0].replace('/fl', '/*')}`"


def columns_text() -> str:
    """Return the page."""
    meanings = texts_below_keys(BrakeRow)
    brakes = [(f"`{name}`", unit, " ".join(meanings[name].split())) for name, unit in BRAKE_UNITS.items()]
    return "\n".join(
        [
            HEAD,
            "## Rows\n\n`RESULT.parquet`, one every 10 ms.\n",
            *table("| column | unit | meaning | topic |", _rows()),
            "",
            "## Brake applications\n\n`RESULT.brakes.parquet`, topic `/brakes`; one for each and wheel.\n",
            *table("| column | unit | meaning |", brakes),
            "",
        ]
    )
