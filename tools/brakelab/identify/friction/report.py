"""`brake-ecu lab report`: the sections of a recorded programme, and two linings side by side."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.identify.friction.comparison import compare, comparison_table
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
from brakelab.identify.friction.whole import inputs_of, read_whole
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


def report(data: list[Path], columns: Path | None, programme: str | None, out: Path | None) -> int:
    """Print the tables of a recorded programme, of two beside each other, and write a page to `out`.
    Returns 0.

    A recording is a file or a folder; three and more of `data` are parts of one. `columns` describes all,
    default: the file beside each; `programme`: a file or a name of config/rig, default: the one of those
    shipped that most of the stops are of.

    Raises:
        UserError: a file cannot be read or makes no physical sense, or is of no such programme; one line.
    """
    if out is not None:
        if out.suffix != ".html":
            raise UserError("--out", str(out), "is written as HTML; let the name end in .html")
        check_outputs(out, (out,), inputs_of(data, columns))
    one, *others = [[path] for path in data] if len(data) <= 2 else [data]
    first = _measure(one, columns, _programmes(programme))
    recordings = [first[1], *(_measure(other, columns, [first[0]])[1] for other in others)]
    if others and recordings[0].name == recordings[1].name:
        recordings = [each._replace(name=str(path)) for each, path in zip(recordings, data, strict=True)]
    title = f"{first[0].title}, {' and '.join(each.name for each in recordings)}"
    tables = []
    for each in recordings:
        tables += [section_table(f"{first[0].title}, {each.name}", each), characteristics(each)]
        tables.append(line_table(each))
    if others:
        first_of, second_of = recordings
        compared = compare(first_of, second_of)
        tables.append(comparison_table(first_of, second_of, compared))
        give(compared=compared)
    tables = [table for table in tables if table.rows]
    for table in tables:
        show(new_console(), table)
    give(programme=first[0].title, recordings=[_as_rows(each) for each in recordings])
    if out is not None:
        write_report_page(out, title, recordings, tables)
        wrote(out)
    return 0


def _programmes(named_one: str | None) -> list[Sequence]:
    if named_one is None:
        return [load_sequence(path) for path in sorted(resource("config/rig").glob("*.toml"))]
    return [read_sequence(named(named_one, "config/rig"))]


def _measure(data: list[Path], columns: Path | None, known: list[Sequence]) -> tuple[Sequence, Measured]:
    """Return the programme of `known` that a recording is of, and what is measured of it."""
    read = read_whole(data, columns)
    path = data[0] if len(data) == 1 else data[0].parent
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
    return sequence, measured(path.stem or read.columns.name, stops, read.columns, parts, outside)


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
