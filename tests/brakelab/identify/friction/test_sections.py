"""Sections are found in what a rig recorded: with stops missing, added, elsewhere; and by their numbers."""

from typing import NamedTuple

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.sections import Conditions, conditions_of, find_sections, number_of
from brakelab.identify.friction.sequence import Sequence, load_sequence
from brakelab.identify.friction.stops import Stops, find_stops
from ecu.settings.resources import resource

AK_MASTER = load_sequence(resource("config/rig/ak-master.toml"))
WHOLE = {one.name.split()[0]: len(one.each()) for one in AK_MASTER.section}


class Row(NamedTuple):
    """A stop that a programme asks for."""

    section: str
    speed: float
    end_speed: float
    pressure: float
    deceleration: float
    temperature: float


def asked(sequence: Sequence) -> list[Row]:
    """Return all stops in their order; where one of pressure and deceleration is free, by friction 0.4."""
    rows = []
    for one in sequence.section:
        for level, wanted in one.each():
            by_pressure = one.control == "pressure"
            pressure, slowed = (level, 0.18 * level) if by_pressure else (level / 0.18, level)
            number = one.name.split()[0]
            rows.append(Row(number, one.speed, one.end_speed, pressure, slowed, wanted))
    return rows


def recorded(rows: list[Row], seed: int = 0) -> Conditions:
    """Return the stops as a rig meets them: speeds to 1 km/h, pressure to 2 %, temperature to 5 K."""
    random = np.random.default_rng(seed)
    _, speed, end_speed, pressure, slowed, wanted = map(np.array, zip(*rows, strict=True))
    count = len(rows)
    nothing = np.zeros(count)
    return Conditions(
        speed + random.normal(0.0, 1.0, count),
        end_speed + random.normal(0.0, 1.0, count),
        pressure * random.normal(1.0, 0.02, count),
        slowed * random.normal(1.0, 0.05, count),
        wanted + random.normal(0.0, 5.0, count),
        *[nothing] * 4,
        np.zeros((count, 3)),
    )


ALL = asked(AK_MASTER)
LOST = [row for k, row in enumerate(ALL) if k not in (3, 40, 41, 110, 180)]
FAST = [row._replace(speed=200.0, end_speed=170.0) if row.section == "4.5" else row for row in ALL]
SLOW = [row._replace(speed=150.0, end_speed=120.0) if row.section in ("4.4", "4.5") else row for row in ALL]
SNUB = Row("", 60.0, 50.0, 20.0, 3.0, 90.0)
"""As some rigs warm the disc."""
COOL = [row._replace(temperature=row.temperature - 40.0) if row.section == "9" else row for row in ALL]


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        pytest.param(ALL, WHOLE, id="as the standard asks"),
        pytest.param([r for r in ALL if r.section not in "12"], WHOLE | {"1": 0, "2": 0}, id="bedded before"),
        pytest.param(LOST, WHOLE | {"1": 29, "2": 62, "4.2": 7, "9": 14}, id="five stops lost"),
        pytest.param(ALL[:150], WHOLE | dict.fromkeys(list(WHOLE)[12:], 0) | {"8": 1}, id="ended early"),
        pytest.param(FAST, WHOLE, id="4.5 from 200 to 170 km/h"),
        pytest.param(SLOW, WHOLE, id="a car of 170 km/h"),
        pytest.param([r for row in ALL for r in (SNUB, row)], WHOLE, id="a snub before each"),
        pytest.param(COOL, WHOLE, id="fade 40 K too cool"),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_each_stop_is_of_its_section(rows: list[Row], expected: dict[str, int], seed: int) -> None:
    parts, outside = find_sections(AK_MASTER, recorded(rows, seed))
    found = {part.name.split()[0]: len(part.stops) for part in parts}
    assert found == {name: count for name, count in expected.items() if count}
    for part in parts:
        assert {rows[k].section for k in part.stops} == {part.name.split()[0]}
    assert [rows[k] for k in outside] == [row for row in rows if row is SNUB]


def test_a_column_of_sections_decides_what_the_stops_leave_open() -> None:
    """Recoveries look like characteristic values: 18 stops of either."""
    rows = [row for row in ALL if row.section == "13"]
    alone, _ = find_sections(AK_MASTER, recorded(rows))
    by_label, _ = find_sections(AK_MASTER, recorded(rows), np.array(["13 recovery"] * len(rows)))
    assert [part.name for part in by_label] == ["13 recovery 2"]
    assert [part.name for part in alone] != ["13 recovery 2"]


def test_a_number_of_the_whole_section_fits_its_parts() -> None:
    rows = [row for row in ALL if row.section.startswith("4.")]
    parts, outside = find_sections(AK_MASTER, recorded(rows), np.array(["4"] * len(rows)))
    assert [len(part.stops) for part in parts] == [8] * 5
    assert len(outside) == 0


def test_another_programme_is_mostly_outside() -> None:
    rows = asked(load_sequence(resource("config/rig/cpc.toml")))
    _, outside = find_sections(AK_MASTER, recorded(rows))
    assert len(outside) > 0.6 * len(rows)


@pytest.mark.parametrize(
    ("label", "number"),
    [("4.3 pressure", "4.3"), ("9", "9"), (" 12.1", "12.1"), ("Fade 1", ""), ("", "")],
)
def test_the_number_of_a_label(label: str, number: str) -> None:
    assert number_of(label) == number


def test_the_conditions_of_stops(recording: Recording, columns: Columns, stops: Stops) -> None:
    """80 and 120 to 30 km/h at 15 to 70 bar; deceleration by the flywheel; the ramp of the rig is 0.15 s."""
    found = conditions_of(stops, columns)
    assert sorted(set(np.round(found.speed))) == [80.0, 120.0] or np.allclose(
        sorted(set(np.round(found.speed / 40.0))), [2.0, 3.0]
    )
    assert found.end_speed == pytest.approx(np.full(24, 30.0), abs=3.0)
    assert found.pressure[:4] == pytest.approx([15.0, 30.0, 50.0, 70.0], rel=0.02)
    assert columns.rig.inertia is not None
    slowed = stops.lever * stops.held_pressure * stops.mean / columns.rig.inertia * columns.brake.tyre_radius
    assert found.deceleration == pytest.approx(slowed, rel=0.15)
    assert found.gradient == pytest.approx(found.pressure / 0.15, rel=0.25)
    assert np.all(found.least <= stops.mean)
    assert np.all(stops.mean <= found.greatest)


def test_friction_at_two_speeds_within_a_stop(columns: Columns) -> None:
    """Friction rises in a straight line from 0.3 at 80 km/h to 0.5 at 20 km/h: Figure 3.4."""
    time = np.arange(0.0, 6.0, 0.005)
    kmh = np.linspace(80.0, 20.0, len(time))
    mu = 0.3 + 0.2 * (80.0 - kmh) / 60.0
    lever = 2.0 * columns.brake.piston_area * columns.brake.effective_radius
    on_pads = np.full(len(time), 20e5)
    run = Recording(
        time,
        on_pads + 1e5 * columns.rig.push_out_pressure,
        lever * on_pads * mu,
        kmh / 3.6 / columns.brake.tyre_radius,
        np.full(len(time), 120.0),
    )
    at = conditions_of(find_stops(run, columns, "x"), columns).at_marks[0]
    assert at == pytest.approx([0.3, 0.3667, 0.4667], abs=0.003)
