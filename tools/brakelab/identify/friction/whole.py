"""Recordings of one brake in several files, a file a stop too, or in a folder of such files."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.identify.friction.check import refuse_nonsense
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.reader import PLACES, Labels, read_recording
from brakelab.identify.friction.recording import Recording, joined
from brakelab.identify.friction.sensors import refuse_hung
from ecu.errors import UserError
from ecu.output import say

SINGLE_S: Final = 60.0
"""A shorter recording may be of a single stop, hot from its begin: such are judged together."""
BETWEEN: Final = 600.0
"""s between recordings."""


class Whole(NamedTuple):
    """Recordings one after the other, of one brake."""

    recording: Recording
    columns: Columns
    sections: Labels
    """What the column of sections has, shape (samples,); without one, empty texts."""
    heating: float  # K/J


def files_of(data: Sequence[Path], columns: Path | None) -> list[tuple[Path, Path | None]]:
    """Return each file of recordings with its file of columns, None: the one of the same name.

    A folder stands for its recordings; beside it FOLDER.toml describes them. What is in the order of letters,
    as a shell writes it, is in that of numbers: stop 2 before stop 10.

    Raises:
        UserError: a folder has no recordings.
    """
    files: list[tuple[Path, Path | None]] = []
    for path in sorted(data, key=_numbered) if list(data) == sorted(data) else data:
        if not path.is_dir():
            files.append((path, columns))
            continue
        found = sorted((one for one in path.iterdir() if one.suffix.lower() in PLACES), key=_numbered)
        if not found:
            raise UserError(
                str(path), "", f"is a folder without recordings; give files of {' '.join(PLACES)}"
            )
        beside = path.with_name(f"{path.name}.toml")
        described = columns or (beside if beside.is_file() else None)
        files += [(one, described) for one in found]
    return files


def inputs_of(data: Sequence[Path], columns: Path | None) -> list[Path]:
    """Return all files that recordings are read from."""
    return [
        each for path, given in files_of(data, columns) for each in (path, given or path.with_suffix(".toml"))
    ]


def _numbered(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def read_whole(data: Sequence[Path], columns: Path | None) -> Whole:
    """Return recordings of one brake, one after the other; the time of a single one is its own.

    Raises:
        UserError: a file cannot be read, makes no physical sense, or is of another brake; one line.
    """
    files = files_of(data, columns)
    parts: list[Recording] = []
    labels: list[Labels] = []
    short: list[int] = []
    damaged: list[str] = []
    first: Columns | None = None
    heating = []
    for place, (path, given) in enumerate(files):
        read = read_recording(path, given)
        if read.damaged:
            damaged.append(read.damaged)
        if first is None:
            first = read.columns
        elif (read.columns.brake, read.columns.rig) != (first.brake, first.rig):
            remedy = f"differ from those of {files[0][0]}; identify one brake at a time"
            raise UserError(str(path), "brake, rig", remedy)
        if len(files) > 1 and np.ptp(read.recording.time) < SINGLE_S:
            short.append(place)
        else:
            heating.append(refuse_nonsense(read.recording, read.columns, str(path)).heating)
            shown = np.where(
                read.recording.torque == 0.0, np.nan, read.recording.torque
            )  # dead stops are said
            refuse_hung(read.recording._replace(torque=shown), read.columns, str(path), ("torque",))
        begin = parts[-1].time[-1] + BETWEEN if parts else 0.0
        shifted = read.recording.time - read.recording.time[0] + begin
        parts.append(read.recording._replace(time=shifted) if len(files) > 1 else read.recording)
        labels.append(read.sections)
    assert first is not None
    if damaged:
        say(f"{damaged[0]}{f'; rows of {len(damaged) - 1} more files, too' if len(damaged) > 1 else ''}")
    if short:
        where = f"{files[short[0]][0]}{f' and {len(short) - 1} more' if len(short) > 1 else ''}"
        heating.append(refuse_nonsense(joined([parts[place] for place in short]), first, where).heating)
    return Whole(joined(parts), first, np.concatenate(labels), float(np.median(heating)))
