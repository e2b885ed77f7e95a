"""`brake-ecu lab report`: the sections of a recorded programme, and two linings side by side."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.identify.friction.check import refuse_nonsense
from brakelab.identify.friction.comparison import compare, comparison_table
from brakelab.identify.friction.reader import read_recording
from brakelab.identify.friction.report_page import write_report_page
from brakelab.identify.friction.report_tables import (
    Measured,
    characteristics,
    line_table,
    measured,
    section_table,
)
from brakelab.identify.friction.sections import conditions_of, find_sections, number_of, speed_ratio
from brakelab.identify.friction.sequence import Sequence, load_sequence, read_sequence
from brakelab.identify.friction.stops import find_stops, say_dead
from brakelab.results.console import new_console
from brakelab.results.outputs import check_outputs
from brakelab.results.text_table import show
from ecu.errors import UserError
from ecu.output import give, say, wrote
from ecu.settings.resources import named, resource

DOUBTFUL_SPEED: Final = 0.08
"""Share by which most stops begin faster or slower than the programme asks, that is no rig's tolerance."""
ENOUGH: Final = 0.5
"""Share of the stops of a recording that must be of a section."""


def report(
    data: Path, other: Path | None, columns: Path | None, programme: str | None, out: Path | None
) -> int:
    """Print the tables of a recorded programme, of `other` beside it, and write a page to `out`. Returns 0.

    `columns` describes both recordings, default: the file beside each; `programme`: a file or a name of
    config/rig, default: the one of those shipped that most of the stops are of.

    Raises:
        UserError: a file cannot be read or makes no physical sense, or is of no such programme; one line.
    """
    paths = [data, *([other] if other else [])]
    if out is not None:
        if out.suffix != ".html":
            raise UserError("--out", str(out), "is written as HTML; let the name end in .html")
        check_outputs(out, (out,), [*paths, *(columns or path.with_suffix(".toml") for path in paths)])
    known = _programmes(programme)
    first = _measure(data, columns, known)
    recordings = [first[1]]
    title = f"{first[0].title}, {first[1].name}"
    if other is not None:
        recordings.append(_measure(other, columns, [first[0]])[1])
        if data.stem == other.stem:
            recordings = [one._replace(name=str(path)) for one, path in zip(recordings, paths, strict=True)]
            title = f"{first[0].title}, {data}"
        title += f" and {recordings[1].name}"
    tables = []
    for one in recordings:
        tables += [section_table(f"{first[0].title}, {one.name}", one), characteristics(one)]
        tables.append(line_table(one))
    if other is not None:
        first_of, second_of = recordings
        compared = compare(first_of, second_of)
        tables.append(comparison_table(first_of, second_of, compared))
        give(compared=compared)
    tables = [table for table in tables if table.rows]
    for table in tables:
        show(new_console(), table)
    give(programme=first[0].title, recordings=[_as_rows(one) for one in recordings])
    if out is not None:
        write_report_page(out, title, recordings, tables)
        wrote(out)
    return 0


def _programmes(named_one: str | None) -> list[Sequence]:
    if named_one is None:
        return [load_sequence(path) for path in sorted(resource("config/rig").glob("*.toml"))]
    return [read_sequence(named(named_one, "config/rig"))]


def _measure(path: Path, columns: Path | None, known: list[Sequence]) -> tuple[Sequence, Measured]:
    """Return the programme of `known` that a recording is of, and what is measured of it."""
    read = read_recording(path, columns)
    if read.damaged:
        say(read.damaged)
    refuse_nonsense(read.recording, read.columns, str(path))
    stops = find_stops(read.recording, read.columns, str(path))
    say_dead(stops, str(path))
    labels = read.sections[np.searchsorted(read.recording.time, stops.begin)]
    if read.columns.columns.section is not None and not any(map(number_of, labels)):
        say(f"{path}: {read.columns.columns.section} has no numbers; sections follow from the stops alone")
    conditions = conditions_of(stops, read.columns)
    fits = [(one, *find_sections(one, conditions, labels)) for one in known]
    sequence, parts, outside = min(fits, key=lambda fit: len(fit[2]))
    if len(stops) - len(outside) < ENOUGH * len(stops):
        remedy = f"only {len(stops) - len(outside)} of {len(stops)} stops are of it; give --programme"
        raise UserError(str(path), sequence.title, remedy)
    if (off := speed_ratio(sequence, parts, conditions)) and abs(off - 1.0) > DOUBTFUL_SPEED:
        say(
            f"{path}: the stops begin at {off:.2f} times the speeds of {sequence.title}: check the unit of "
            "speed and the tyre radius; of a programme of other speeds give --programme"
        )
    return sequence, measured(path.stem, stops, read.columns, parts, outside)


def _as_rows(of: Measured) -> dict[str, object]:
    """Return every stop of a recording with its section, for `--json`."""
    section = np.full(len(of.stops), "", object)
    for part in of.parts:
        section[part.stops] = part.name
    found = of.conditions._asdict()
    at = found.pop("at_marks")
    rows = {"begin": of.stops.begin, "section": section, "mu": of.stops.mean, **found}
    if of.u is not None:
        rows["u"] = of.u
    names = list(rows)
    stops = [dict(zip(names, row, strict=True)) for row in zip(*rows.values(), strict=True)]
    for stop, marks in zip(stops, at, strict=True):
        stop["mu_at_beginning_60_30"] = marks
    return {"name": of.name, "stops": stops}
