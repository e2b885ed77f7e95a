"""A sheet with a row a stop in place of a recording."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.friction.choice import known_candidates
from brakelab.identify.friction.columns import Columns, columns_text
from brakelab.identify.friction.reader import read_recording
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import Stops, find_stops
from ecu.errors import UserError
from tests.brakelab.identify.friction.test_reader import in_columns

pytestmark = pytest.mark.study


SUMMARY = """name = "sheet"
[columns]
time = ["t_Stop", "s"]
pressure = ["p_mean", "bar"]
torque = ["M_mean", "Nm"]
speed = ["v_start", "km/h"]
temperature = ["T_start", "°C"]
speed_end = ["v_end", "km/h"]
temperature_end = ["T_end", "°C"]
"""


@pytest.fixture
def sheet(tmp_path: Path, recording: Recording, columns: Columns, stops: Stops) -> Path:
    """Return a summary sheet of the recording: a row a stop."""
    rows = ["t_Stop;p_mean;M_mean;v_start;T_start;v_end;T_end"]
    kmh = 3.6 * columns.brake.tyre_radius
    for begin in stops.begin:
        on = (recording.time >= begin) & (recording.time < begin + 60.0) & (recording.pressure > 1.5e5)
        t, p, torque, speed, heat = (values[on] for values in recording)
        row = (
            t[-1] - t[0],
            1e-5 * p.mean(),
            torque.mean(),
            kmh * speed[0],
            heat[0],
            kmh * speed[-1],
            heat[-1],
        )
        rows.append(";".join(f"{value:.3f}".replace(".", ",") for value in row))
    path = tmp_path / "sheet.csv"
    path.write_text("\n".join([*rows, ""]), "utf-8")
    brake = columns_text(columns)
    path.with_suffix(".toml").write_text(SUMMARY + brake[brake.index("[brake]") :], "utf-8")
    return path


def test_a_row_a_stop_becomes_stops_of_the_same_friction(sheet: Path, stops: Stops) -> None:
    read = read_recording(sheet)
    found = find_stops(read.recording, read.columns, "sheet")
    assert len(found) == len(stops) == 24
    np.testing.assert_allclose(found.mean, stops.mean, rtol=0.05)
    np.testing.assert_allclose(found.start_temperature, stops.start_temperature, atol=2.0)
    np.testing.assert_allclose(found.inertia, stops.inertia, rtol=0.05)
    tried = {law.name for law in known_candidates(read.columns, found)}
    assert tried >= {"surface", "table", "quadratic"}
    assert "ostermeyer" not in tried


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            'speed_end = ["v_end", "km/h"]\n',
            "",
            "belongs to rows that are stops: give speed_end",
        ),
        ('"v_end", "km/h"', '"v_end", "knots"', "unit 'knots' of speed_end unknown"),
    ],
)
def test_a_sheet_that_is_described_wrongly_is_one_line(sheet: Path, old: str, new: str, line: str) -> None:
    in_columns(sheet, old, new)
    with pytest.raises(UserError, match=line):
        read_recording(sheet)


def test_a_stop_without_a_duration_is_named(sheet: Path) -> None:
    lines = sheet.read_text().splitlines()
    lines[3] = "0;" + lines[3].partition(";")[2]
    sheet.write_text("\n".join(lines))
    with pytest.raises(UserError, match="stop 3: t_Stop and p_mean must be above zero in a summary"):
        read_recording(sheet)
