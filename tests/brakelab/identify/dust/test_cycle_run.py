"""`identify dust --cycle`: a run of the WLTP-Brake cycle with a rig's errors, against sums by hand."""

import csv
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.identify.dust.cycle_page import findings, report_cycle
from brakelab.identify.dust.cycle_run import PERIOD, read_run
from brakelab.identify.dust.reader import COLUMNS
from brakelab.simulation.trip.wltp_brake import TOTALS, TRIPS, wltp_brake
from ecu.errors import UserError
from ecu.settings.config import load_config

pytestmark = pytest.mark.study

CONFIG = Path(__file__).parents[4] / "config" / "suv.toml"
SLOWED, RADIUS, FLOW = 600.0, 0.355, 0.25  # kg, m, m^3/s
WHOLE = {
    "pm10_filter": 1.20, "pm10_flow": 1.6e-4, "pm25_filter": 0.5, "pm25_flow": 1.6e-4,
    "pads_mass_before": 812.40, "pads_mass_after": 810.90,
    "disc_mass_before": 9120.0, "disc_mass_after": 9118.6, "friction_share": 0.5,
}  # fmt: skip


def trip_columns(number: int, random: np.random.Generator) -> dict[str, np.ndarray]:
    """Return a trip as a rig records it: late by 2 s, noisy, a counter once a second with an offset."""
    rows = wltp_brake(number)
    t = np.arange(0.0, rows[-1, 0], 0.1)
    v = np.interp(t, rows[:, 0], rows[:, 1])
    braking = np.maximum(-np.gradient(v, t) - 0.1, 0.0)
    torque = SLOWED * braking * RADIUS
    heat = np.empty_like(t)
    heat[0] = 23.0 if number == 1 else 41.0
    for k in range(1, len(t)):
        heat[k] = heat[k - 1] + 0.1 * (2.2e-4 * torque[k] * v[k] / RADIUS - 0.004 * (heat[k - 1] - 22.0))
    emitted = 20.0 * torque * v / RADIUS / FLOW / 1e2
    counted = 180.0 + 6.0 * v + np.convolve(emitted, np.full(20, 0.05))[: len(t)]
    counted = np.where(np.arange(len(t)) % 10 == 0, counted * (1 + 0.04 * random.normal(size=len(t))), np.nan)
    values = (
        t, np.maximum(v + 0.05 * random.normal(size=len(t)), 0.0),
        0.5 + np.where(torque > 1.0, torque / 23.0, 0.0) + 0.1 * random.normal(size=len(t)),
        torque * (1 + 0.02 * random.normal(size=len(t))), heat + 0.5 * random.normal(size=len(t)), counted,
        FLOW * (1 + 0.01 * random.normal(size=len(t))),
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True)) | {"solid_concentration": 0.7 * counted}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder, random = tmp_path_factory.mktemp("run"), np.random.default_rng(4)
    with (folder / "run.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, ["trip", "file", "reference", *WHOLE])
        writer.writeheader()
        for number in range(1, len(TRIPS) + 1):
            pq.write_table(pa.table(trip_columns(number, random)), folder / f"{number}.parquet")
            rows = wltp_brake(number)
            np.savetxt(folder / f"ref{number}.csv", rows, "%.3f", ",", header="t,vehicle_speed", comments="")
            row = {"trip": number, "file": f"{number}.parquet", "reference": f"ref{number}.csv"}
            writer.writerow(row | (WHOLE if number == 3 else {}))
    return folder


def rewritten(folder: Path, out: Path, change) -> Path:
    """Return a manifest beside `out` with changed rows; files by their whole paths."""
    with (folder / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row |= {name: str(folder / row[name]) for name in ("file", "reference")}
    rows = change(rows) or rows
    with out.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return out


def test_a_run_is_the_sums_of_what_was_recorded(made):
    run = read_run(made / "run.csv", load_config(CONFIG), "front")
    km = sum(trip.km for trip in run.trips)
    assert km == pytest.approx(1e-3 * TOTALS.metres, rel=2e-3)
    assert sum(trip.applications for trip in run.trips) == pytest.approx(TOTALS.brakings, abs=6)
    assert run.mass("pm10") == pytest.approx(0.5 * 1.20 * FLOW / 1.6e-4 / km, rel=2e-3)
    assert run.mass("pm25") / run.mass("pm10") == pytest.approx(0.5 / 1.2)
    assert run.lost("pads") == pytest.approx(1e3 * 1.5 / km, rel=1e-3)
    assert run.lost("disc") == pytest.approx(1e3 * 1.4 / km, rel=1e-3)
    counted = 0.0
    for number in range(1, 11):
        columns = pq.read_table(made / f"{number}.parquet").to_pydict()
        seen = np.array(columns["particle_concentration"])
        t, known = np.array(columns["t"]), np.isfinite(seen)
        grid = np.arange(t[0], t[-1], PERIOD)
        counted += 1e6 * FLOW * PERIOD * np.interp(grid, t[known], seen[known]).sum()
    assert run.number("total") == pytest.approx(0.5 * counted / km, rel=2e-3)
    assert run.number("solid") == pytest.approx(0.7 * run.number("total"), rel=1e-6)
    assert 0.15 < run.number("background") / run.number("total") < 1.0
    assert run.trips[0].cold == pytest.approx(23.0, abs=1.0)
    assert findings(run) == []


def test_the_page_says_what_is_known_and_what_is_not(made, tmp_path, capsys):
    out = tmp_path / "run.md"
    report_cycle(made / "run.csv", CONFIG, "front", out)
    page = out.read_text()
    assert "was not at hand" in page
    assert "Regulation (EU) 2024/1257" in page
    assert "Nothing is off what is published" in page
    assert "| SPN10" in page
    assert "PM10" in capsys.readouterr().out


def slow(rows):
    rows[1]["reference"] = rows[0]["reference"]


def changed(made: Path, tmp_path: Path, number: int, change) -> Path:
    """Return the manifest of a run whose trip `number` has other columns."""
    columns = {
        name: np.array(values, float)
        for name, values in pq.read_table(made / f"{number}.parquet").to_pydict().items()
    }
    pq.write_table(pa.table(change(columns) or columns), tmp_path / "changed.parquet")
    return rewritten(
        made,
        tmp_path / "r.csv",
        lambda rows: rows[number - 1].update(file=str(tmp_path / "changed.parquet")),
    )


OWN = """
[columns]
time = ["Zeit", "ms"]
speed = ["v_ist", "km/h"]
pressure = ["p", "kPa"]
torque = ["M", "Nm"]
temperature = ["T", "°F"]
concentration = ["TPN10", "1/l"]
flow = ["Q", "m³/h"]
solid = ["SPN10", "1/l"]
"""


def test_trips_of_other_names_and_units_are_the_same_run(made, tmp_path):
    """Solid particles included."""
    (tmp_path / "own.toml").write_text(OWN)
    names = ("Zeit", "v_ist", "p", "M", "T", "TPN10", "Q", "SPN10")
    factors = (1e3, 3.6, 100.0, 1.0, 1.8, 1e3, 3600.0, 1e3)

    def renamed(rows):
        for row in rows[:3]:
            columns = pq.read_table(row["file"]).to_pydict().values()
            values = [np.array(column, float) * by for column, by in zip(columns, factors, strict=True)]
            values[4] += 32.0
            row["file"] = str(tmp_path / Path(row["file"]).name)
            pq.write_table(pa.table(dict(zip(names, values, strict=True))), row["file"])
        return rows[:3]

    config = load_config(CONFIG)
    as_ours = read_run(rewritten(made, tmp_path / "ours.csv", lambda rows: rows[:3]), config, "front")
    theirs = read_run(rewritten(made, tmp_path / "r.csv", renamed), config, "front", tmp_path / "own.toml")
    assert theirs.trips == [
        type(one)(one.name, *(pytest.approx(value, rel=1e-6) for value in one[1:])) for one in as_ours.trips
    ]


def test_a_unit_of_solid_particles_is_one_of_those_known(made, tmp_path):
    (tmp_path / "own.toml").write_text(OWN.replace('"SPN10", "1/l"', '"SPN10", "ppm"'))
    with pytest.raises(UserError, match="unit 'ppm' of solid unknown"):
        read_run(made / "run.csv", load_config(CONFIG), "front", tmp_path / "own.toml")


def test_what_is_of_the_whole_run_may_have_a_row_of_its_own(made, tmp_path):
    def apart(rows):
        rows[2] |= dict.fromkeys(WHOLE, "")
        return [*rows, dict.fromkeys(rows[0], "") | {"trip": "sum"} | WHOLE]

    config = load_config(CONFIG)
    run = read_run(rewritten(made, tmp_path / "r.csv", apart), config, "front")
    assert run.whole == read_run(made / "run.csv", config, "front").whole
    assert len(run.trips) == len(TRIPS)


def test_the_background_is_that_of_air_that_was_late(made, tmp_path):
    """By 20 s, as through a long line: plumes fall into what would be cruising."""

    def late(columns):
        for name in ("particle_concentration", "solid_concentration"):
            columns[name] = np.roll(columns[name], 200)

    config = load_config(CONFIG)
    before = read_run(made / "run.csv", config, "front").trips[2].background
    after = read_run(changed(made, tmp_path, 3, late), config, "front").trips[2].background
    assert after == pytest.approx(before, rel=0.02)


def warmer(columns):
    columns["disc_temperature_fr"] += 60.0


def ends_early(columns):
    columns["particle_concentration"] = np.roll(columns["particle_concentration"], 80)
    last = np.flatnonzero(columns["brake_torque_fr"] > 100.0)[-1] + 30
    return {name: values[:last] for name, values in columns.items()}


@pytest.mark.parametrize(
    ("change", "said"),
    [(warmer, "disc over 5 K too warm at the start of trip 3"), (ends_early, "trip 3: its file ends")],
)
def test_a_trip_that_was_not_run_as_asked_is_found(made, tmp_path, change, said):
    run = read_run(changed(made, tmp_path, 3, change), load_config(CONFIG), "front")
    assert any(said in line for line in findings(run)), findings(run)


FOUND = {
    "a trip missing": (lambda rows: rows[:-1], "9 of 10 trips"),
    "no filter": (lambda rows: rows[2].update(pm10_filter="", pm10_flow=""), "PM10 was not weighed"),
    "no reference": (lambda rows: rows[4].update(reference=""), "no reference of every trip"),
    "masses in kg": (
        lambda rows: rows[2].update(
            pads_mass_before="0.8124",
            pads_mass_after="0.8109",
            disc_mass_before="9.12",
            disc_mass_after="9.1186",
        ),
        "% of what pads and disc lost",
    ),
    "fifty times the dust": (lambda rows: rows[2].update(pm10_filter="60"), "above every limit"),
}


@pytest.mark.parametrize(("change", "said"), FOUND.values(), ids=FOUND)
def test_what_is_off_is_found(made, tmp_path, change, said):
    run = read_run(rewritten(made, tmp_path / "r.csv", change), load_config(CONFIG), "front")
    assert any(said in line for line in findings(run)), findings(run)


@pytest.mark.parametrize(
    ("seconds", "faster", "violations"), [(5.0, 3.0, 1), (5.0, 1.0, 0), (0.0, 0.0, 0)], ids=str
)
def test_speed_off_its_trace_is_a_violation(made, tmp_path, seconds, faster, violations):
    """`faster` [km/h] for `seconds`, where the third trip cruises longest."""
    held = wltp_brake(3)
    begin = held[np.argmax(np.where(np.diff(held[:, 1]) == 0.0, np.diff(held[:, 0]), 0.0)), 0] + 2.0
    columns = {
        name: np.array(values) for name, values in pq.read_table(made / "3.parquet").to_pydict().items()
    }
    part = (columns["t"] > begin) & (columns["t"] < begin + seconds)
    columns["vehicle_speed"][part] += faster / 3.6
    pq.write_table(pa.table(columns), tmp_path / "3.parquet")
    manifest = rewritten(
        made, tmp_path / "r.csv", lambda rows: rows[2].update(file=str(tmp_path / "3.parquet"))
    )
    trip = read_run(manifest, load_config(CONFIG), "front").trips[2]
    assert trip.violations == violations
    assert trip.outside == pytest.approx(seconds * violations, abs=0.5 * seconds + 0.01)


BAD = {
    "no rows": (lambda rows: [rows[0] | {"trip": ""}], "line 2: needs trip and file"),
    "the whole run twice": (lambda rows: rows[5].update(pm10_filter="2"), "line 7, pm10_filter: 2, and 1.2"),
    "text": (lambda rows: rows[2].update(pm25_filter="light"), "pm25_filter: give a number"),
    "half a pair": (
        lambda rows: rows[2].update(pads_mass_after=""),
        "pads_mass_after: missing; pads_mass_bef",
    ),
    "filters exchanged": (lambda rows: rows[2].update(pm25_filter="1.9"), "more than PM10"),
    "a filter in µg": (lambda rows: rows[2].update(pm10_filter="1200"), "1200 mg on a filter cannot be"),
    "a flow in l/min": (
        lambda rows: rows[2].update(pm10_flow="9.6", pm25_flow="9.6"),
        "9.6 m.3/s drawn of 0.25 m.3/s",
    ),
    "a trip twice": (lambda rows: rows[4].update(file=rows[3]["file"]), "is the trip of line 5"),
    "pads that gained": (lambda rows: rows[2].update(pads_mass_after="815"), "pads gained mass"),
    "c in %": (lambda rows: rows[2].update(friction_share="50"), "50 is not of 0 to 1"),
    "another trip's reference": (slow, "ref1.csv: t: 1200 s, the trip 900 s"),
}


@pytest.mark.parametrize(("change", "said"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_line(made, tmp_path, change, said):
    manifest = rewritten(made, tmp_path / "r.csv", change)
    with pytest.raises(UserError, match=said) as caught:
        report_cycle(manifest, CONFIG, "front", tmp_path / "run.md")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "run.md").exists()


def test_the_page_is_a_page(made):
    with pytest.raises(UserError, match=r"let it end in \.md"):
        report_cycle(made / "run.csv", CONFIG, "front", made / "car.toml")
