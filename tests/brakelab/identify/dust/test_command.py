"""`brake-ecu identify dust`: from simulated trips to a configuration; what bad trips give."""

import csv
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="needs scikit-learn (extra learn)")

from brakelab.identify.dust import reader
from brakelab.identify.dust.command import identify_dust
from brakelab.simulation.campaigns.dust_trips import COLUMNS, campaign, write_campaign
from ecu.errors import RunFault, UserError
from ecu.settings.config import load_config, new_params, store_key

pytestmark = pytest.mark.study

CONFIG = Path(__file__).parents[4] / "config" / "lcv.toml"


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dust")
    write_campaign(campaign(3, trips=4), folder)
    return folder


@pytest.fixture
def trips(made, tmp_path) -> Path:
    shutil.copytree(made, tmp_path / "trips")
    return tmp_path / "trips"


@pytest.fixture(scope="session")
def made_short(made, tmp_path_factory) -> Path:
    """The first third of each trip: enough to see most that may be wrong with it."""
    folder = tmp_path_factory.mktemp("short")
    for path in made.iterdir():
        lines = path.read_text().splitlines(keepends=True)
        (folder / path.name).write_text("".join(lines if len(lines) < 100 else lines[: len(lines) // 3]))
    return folder


@pytest.fixture
def short_trips(made_short, tmp_path) -> Path:
    shutil.copytree(made_short, tmp_path / "trips")
    return tmp_path / "trips"


def test_trips_become_a_configuration_and_a_page(trips, capsys):
    out = trips / "car.toml"
    identify_dust(trips / "manifest.csv", CONFIG, "front", out)
    config, before = load_config(out), load_config(CONFIG)
    dust = config.front.dust
    assert dust is not None
    assert config.rear.dust is None
    assert dust.below < 0.0 < dust.above
    assert dust.high[0] > 25.0  # m/s
    assert store_key(config) == store_key(before)  # what was learned of friction goes on
    params = new_params(config)[0]
    assert list(params["dust_model"] >= 0) == [True, True, False, False]
    assert params["dust_version"] != new_params(before)[0]["dust_version"]
    page = (trips / "car.md").read_text()
    assert all(name in page for name in ("LUT", "dynamic ANN", "monotone law", "trip 4 (test)", "Δt_b"))
    drawn = (trips / "car.svg").read_text("utf-8")
    assert all(f"EF by {name}" in drawn for name in ("LUT, ", "dynamic ANN", "monotone law"))
    assert "resampled" in drawn
    assert "trip 4: counter" in drawn  # Figure 8.3
    assert "from 3 trips" in capsys.readouterr().out


def test_a_trip_unlike_the_others_is_named(short_trips, capsys):
    path = short_trips / "trip-2.csv"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 4] = 1.7 * rows[:, 4]  # less than what is refused as °F
    np.savetxt(path, rows, "%.4f", ",", header=path.read_text().splitlines()[0], comments="")
    reader.read_trips(short_trips / "manifest.csv", load_config(CONFIG), "front")
    said = capsys.readouterr().err
    assert re.search(r"trip 2: the same work heats its disc 1\.[5-9] times as much", said)
    assert said.count("heats its disc") == 1


def test_trips_with_a_file_of_columns_give_the_same_model(trips):
    laws = []
    for columns in (None, trips / "map.toml"):
        identify_dust(trips / "manifest.csv", CONFIG, "front", trips / "car.toml", columns)
        laws.append(load_config(trips / "car.toml").front.dust)
        names = ("Zeit", "v", "p", "M", "T", "PN", "Q")
        factors = (1e3, 3.6, 0.1, 1e-3, 1.0, 1e3, 3600.0)
        for path in trips.glob("trip-*.csv") if columns is None else ():
            rows = np.loadtxt(path, delimiter=",", skiprows=1) * factors
            np.savetxt(path, rows, "%.7g", ";", header=";".join(names), comments="")
        (trips / "map.toml").write_text(
            '[columns]\ntime = ["Zeit", "ms"]\nspeed = ["v", "km/h"]\npressure = ["p", "MPa"]\n'
            'torque = ["M", "kN m"]\ntemperature = ["T", "°C"]\nconcentration = ["PN", "1/l"]\n'
            'flow = ["Q", "m³/h"]\n',
            encoding="utf-8",
        )
    assert laws[0].model == laws[1].model
    assert laws[1].numbers == pytest.approx(laws[0].numbers, rel=0.02, abs=0.02)


def test_trips_of_a_car_whose_configuration_includes_another(trips):
    start, out = CONFIG.with_name("suv-blended.toml"), trips / "car.toml"
    identify_dust(trips / "manifest.csv", start, "rear", out)
    config, before = load_config(out), load_config(start)
    assert config.rear.dust is not None
    assert (config.front, config.blending) == (before.front, before.blending)


def rewrite(path: Path, change) -> None:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    change(rows)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def column(name: str, value):
    def spoil(folder: Path) -> None:
        def change(rows):
            for row in rows:
                if row[name] not in ("", "nan"):
                    row[name] = value(float(row[name]))

        rewrite(folder / "trip-1.csv", change)

    return spoil


def without_test(folder: Path) -> None:
    rewrite(folder / "manifest.csv", lambda rows: [row.update(test="yes") for row in rows])


def all_held_out(folder: Path) -> None:
    rewrite(folder / "manifest.csv", lambda rows: [row.update(test="1") for row in rows])


def without_column(folder: Path) -> None:
    path = folder / "trip-1.csv"
    path.write_text(path.read_text().replace("tunnel_flow", "flow", 1))


def backwards(folder: Path) -> None:
    path = folder / "trip-1.csv"
    lines = path.read_text().splitlines(keepends=True)
    lines[5], lines[6] = lines[6], lines[5]
    path.write_text("".join(lines))


BAD = {
    "a count in 1/m^3": (column("particle_concentration", lambda x: 1e6 * x), "1/m.3. convert it"),
    "a counter at its end": (column("particle_concentration", lambda x: min(x, 900.0)), "counts no more"),
    "a pressure in Pa": (
        column("calliper_pressure_fr", lambda x: 1e5 * x),
        "reads like Pa: convert it to bar",
    ),
    "a torque in kN m": (column("brake_torque_fr", lambda x: 1e-3 * x), "reads like kN m: convert it to N m"),
    "a trip without braking": (column("calliper_pressure_fr", lambda x: 0.4), "0 brake applications"),
    "a temperature in °F or K": (column("disc_temperature_fr", lambda x: x + 273.15), "cannot be degC"),
    "a speed in km/h": (column("vehicle_speed", lambda x: 3.6 * x), "km/h"),
    "a flow in m^3/h": (column("tunnel_flow", lambda x: 3600 * x), "of a tunnel"),
    "a counter that is off": (column("particle_concentration", lambda x: ""), "no sample"),
    "a count below zero": (column("particle_concentration", lambda x: x - 1e5), "below zero"),
    "a manifest without test": (without_test, "needs trip, file and test"),
    "nothing to train on": (all_held_out, "3 or more trips with test 0"),
    "a column that is missing": (without_column, "no such column"),
    "a time that falls": (backwards, "must rise"),
}


def assert_refused(folder: Path, spoil, said: str) -> None:
    spoil(folder)
    with pytest.raises(UserError, match=said) as caught:
        identify_dust(folder / "manifest.csv", CONFIG, "front", folder / "car.toml")
    assert "\n" not in str(caught.value)
    assert ".csv" in str(caught.value)
    assert not (folder / "car.toml").exists()


@pytest.mark.parametrize(("spoil", "said"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_line_that_names_file_and_place(short_trips, spoil, said):
    assert_refused(short_trips, spoil, said)


def test_a_whole_trip_shows_degrees_fahrenheit(trips):
    fahrenheit = column("disc_temperature_fr", lambda x: 32.0 + 1.8 * x)
    assert_refused(trips, fahrenheit, "reads like °F: convert")


def test_trips_that_do_not_count_alike_are_no_model(trips):
    """One of four counted three hundredfold: exit 1, and what each counted per work."""
    column("particle_concentration", lambda x: 300.0 * x)(trips)
    with pytest.raises(RunFault, match=r"no model predicts these trips: .* trip 1 \S+ 1/MJ, trip 2 "):
        identify_dust(trips / "manifest.csv", CONFIG, "front", trips / "car.toml")
    assert not (trips / "car.toml").exists()


def without_count(begin: float, end: float):
    def change(rows):
        for row in rows:
            if begin <= float(row["t"]) < end:
                row["particle_concentration"] = "nan"

    return lambda folder: rewrite(folder / "trip-1.csv", change)


def test_a_counter_that_drops_out_costs_the_applications_of_that_time(short_trips, capsys):
    config = load_config(CONFIG)
    whole = reader.read_trips(short_trips / "manifest.csv", config, "front")[0]
    at = float(whole.start[5])
    without_count(at - 10.0, at + 10.0)(short_trips)
    capsys.readouterr()
    found = reader.read_trips(short_trips / "manifest.csv", config, "front")[0]
    assert found.left_out - whole.left_out == len(whole.start) - len(found.start) >= 1
    assert at not in found.start
    assert "trip-1.csv: particle_concentration: no count for " in capsys.readouterr().err


def test_a_trip_that_was_hardly_counted_is_refused(short_trips):
    assert_refused(
        short_trips,
        without_count(100.0, 1e6),
        r"no count for \d+ s in all, first at t = (99|100) s; too much",
    )


# samples [s] -> which of the seconds 0 … 10 lie in a gap: 2.5 periods and more
GAPS = {
    "every second": (range(11), []),
    "three seconds": ([0, 1, 2, 3, 6, 7, 8, 9, 10], [4, 5, 6]),
    "two seconds": ([0, 1, 2, 3, 5, 6, 7, 8, 9, 10], []),
    "late": ([6, 7, 8, 9, 10], [0, 1, 2, 3, 4, 5, 6]),
    "ends early": ([0, 1, 2, 3, 4], [5, 6, 7, 8, 9, 10]),
    "one sample": ([5], [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]),
}


@pytest.mark.parametrize(("samples", "lost"), GAPS.values(), ids=GAPS)
def test_a_gap_is_what_lies_between_samples_too_far_apart(samples, lost):
    found = reader.in_gap(np.array(samples, float), np.arange(11.0))
    assert np.flatnonzero(found).tolist() == lost


def test_columns_are_those_of_the_contract():
    assert reader.COLUMNS == COLUMNS
