"""The real driving cycle: Table 1.1 row by row, what a car and its driver can do, and the table itself."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.report.drive import read_drive
from brakelab.simulation.trip.generate import (
    BRAKE_JERK,
    DRIVE_JERK,
    DT,
    STRONGEST_BRAKING,
    main,
    real_driving,
)
from brakelab.simulation.trip.report import DRIVE_COLUMNS, brake_lines, part_lines
from brakelab.simulation.trip.table import KMH, Brakings, Row, brakings, distance_driven, trip_rows
from ecu.contract.signals import CORNERS

SEEDS = (1, 2, 3, 4, 11)  # the first draw of 11 stands too short a time and is discarded
TABLE_1_1 = [  # name, low, high
    ("Duration", 90.0, 120.0),
    ("Urban trip distance", 16.0, np.inf),
    ("Rural trip distance", 16.0, np.inf),
    ("Motorway trip distance", 16.0, np.inf),
    ("Share of urban", 29.0, 44.0),
    ("Share of rural", 23.0, 43.0),
    ("Share of motorway", 23.0, 43.0),
    ("Share of stop time", 10.0, np.inf),
    ("Time on motorway", 5.0, np.inf),
    ("Average urban speed", 15.0, 40.0),
    ("Maximum speed", -np.inf, 145.0),
    ("Positive altitude gain", -np.inf, 1200.0),
]


def found(speed: list[tuple[float, float]], grade: list[tuple[float, float]]) -> dict[str, Row]:
    """Return the rows of a trip: speed [km/h] by minutes and grade [rad] by minutes, linear in between."""
    t = np.arange(0.0, 60.0 * speed[-1][0] + 0.05, 0.1)
    v = np.interp(t / 60.0, *zip(*speed, strict=True)) * KMH
    return {row.name: row for row in trip_rows(t, v, np.interp(t / 60.0, *zip(*grade, strict=True)))}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("step", [1, 10])
def test_every_row_of_table_1_1_is_met_at_10_hz_and_at_1_hz(seed: int, step: int) -> None:
    trip = real_driving(seed)
    rows = trip_rows(trip.t[::step], trip.speed[::step], trip.grade_by_time()[::step])
    assert [(row.name, row.low, row.high) for row in rows] == TABLE_1_1
    assert [row.name for row in rows if not row.low < row.value < row.high] == []


def test_table_1_1_counts_what_it_says() -> None:
    """12 min stopped, 60 at 30 km/h, 24 at 75, 18 at 96 and 6 at 120; 4 % up, then 4 % down."""
    edges = np.cumsum([12.0, 60.0, 24.0, 18.0, 6.0])
    speeds = [0.0, 30.0, 75.0, 96.0, 120.0]
    steps = [(0.0, 0.0)]
    for edge, speed, after in zip(edges, speeds, [*speeds[1:], 120.0], strict=True):
        steps += [(edge, speed), (edge + 1e-4, after)]
    rows = found(steps[:-1], [(0.0, 0.04), (60.0, 0.04), (60.01, -0.04), (120.0, -0.04)])
    metres = 30e3 + 30e3 + 40.8e3
    expected = {
        "Duration": 120.0,
        "Urban trip distance": 30.0,
        "Rural trip distance": 30.0,
        "Motorway trip distance": 40.8,
        "Share of urban": 30e5 / metres,
        "Share of rural": 30e5 / metres,
        "Share of motorway": 40.8e5 / metres,
        "Share of stop time": 10.0,
        "Time on motorway": 6.0,  # that above 100 km/h
        "Average urban speed": 25.0,
        "Maximum speed": 120.0,
        "Positive altitude gain": 24e3 * np.sin(0.04) / metres * 1e5,
    }
    for name, value in expected.items():
        assert rows[name].value == pytest.approx(value, rel=2e-3), name
    assert not rows["Duration"].met  # 120 min is not below 120 min


@pytest.mark.parametrize(
    ("speed", "row", "value"),
    [
        (0.9, "Share of stop time", 100.0),
        (1.1, "Share of stop time", 0.0),
        (60.0, "Share of urban", 100.0),
        (60.1, "Share of rural", 100.0),
        (90.0, "Share of rural", 100.0),
        (90.1, "Share of motorway", 100.0),
        (99.9, "Time on motorway", 0.0),
        (100.1, "Time on motorway", 10.0),
    ],
)
def test_speeds_divide_a_trip_as_the_regulation_does(speed: float, row: str, value: float) -> None:
    assert found([(0.0, speed), (10.0, speed)], [(0.0, 0.0), (10.0, 0.0)])[row].value == pytest.approx(value)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_seed_gives_the_same_bits_and_another_seed_another_trip(seed: int) -> None:
    one, again, other = real_driving(seed), real_driving(seed), real_driving(seed + 1)
    for a, b in zip(one, again, strict=True):
        assert a.tobytes() == b.tobytes()
    assert other.speed.tobytes() != one.speed.tobytes()
    assert np.allclose(np.diff(one.t), DT, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_car_and_its_driver_can_follow(seed: int) -> None:
    trip = real_driving(seed)
    accel = np.diff(trip.speed) / DT
    jerk = np.diff(accel) / DT
    assert trip.speed.min() == 0.0
    assert accel.max() < 2.0
    assert accel.min() > -STRONGEST_BRAKING
    assert np.abs(jerk).max() < 1.05 * BRAKE_JERK
    assert np.abs(jerk[accel[1:] > 0.1]).max() < 1.05 * DRIVE_JERK


def test_a_change_of_speed_within_one_sample_divides_by_nothing() -> None:
    with np.errstate(all="raise"):  # seed 102 has one of 1 mm/s
        assert np.isfinite(real_driving(102).speed).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_trip_starts_and_stops_at_rest_and_goes_on_after_every_stop(seed: int) -> None:
    trip = real_driving(seed)
    standing = trip.speed == 0.0
    starts = np.flatnonzero(standing[:-1] & ~standing[1:])
    stops = np.flatnonzero(~standing[:-1] & standing[1:])
    assert standing[0]
    assert standing[-1]
    assert len(starts) == len(stops) > 20
    place = distance_driven(trip.t, trip.speed)
    assert (place[stops] - place[starts]).min() > 5.0
    waits = trip.t[starts[1:]] - trip.t[stops[:-1]]
    assert waits.min() > 1.0
    assert np.count_nonzero(waits > 10.0) > 5  # "several stop periods of 10 s or longer", EU 2016/427


@pytest.mark.parametrize("seed", SEEDS)
def test_the_road_is_one_that_exists(seed: int) -> None:
    trip = real_driving(seed)
    place, grade = trip.grade.T
    length = distance_driven(trip.t, trip.speed)[-1]
    height = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(place) * (grade[1:] + grade[:-1]))])
    assert place[0] == 0.0
    assert np.diff(place).min() >= 300.0
    assert place[-1] > length + 500.0  # a car that runs a little long finds road
    assert np.abs(grade).max() <= 0.08
    assert abs(np.interp(length, place, height)) < 100.0  # EU 2016/427: start and end within 100 m


@pytest.mark.parametrize("seed", SEEDS)
def test_the_driving_is_neither_too_tame_nor_too_wild(seed: int) -> None:
    """95th percentile of v*a and relative positive acceleration at 1 Hz, EU 2016/646, appendix 7a."""
    v = real_driving(seed).speed[::10]
    a = np.gradient(v)
    for low, high in ((-1.0, 60.0), (60.0, 90.0), (90.0, 200.0)):
        part = (v > low * KMH) & (v <= high * KMH)
        pushing = part & (a > 0.1)
        mean = v[part].mean() / KMH
        most = 0.136 * mean + 14.44 if mean <= 74.6 else 0.0742 * mean + 18.966
        assert np.percentile((v * a)[pushing], 95) < most
        assert (v * a)[pushing].sum() / v[part].sum() > max(0.1755 - 0.0016 * mean, 0.025)


def test_the_brakings_are_those_of_table_1_2() -> None:
    """Means and spreads of three trips, shares of gentle and of firmer brakings; over ten trips."""
    trips = [real_driving(seed) for seed in range(10)]
    decels = [brakings(trip.t, trip.speed, -np.gradient(trip.speed, trip.t)).mean_decel for trip in trips]
    means, spreads = [d.mean() for d in decels], [d.std() for d in decels]
    every = np.concatenate(decels)
    print(f"means {np.round(means, 2)}, spreads {np.round(spreads, 2)}")
    assert 1.59 <= np.mean(means) <= 1.82
    assert 0.35 <= np.mean(spreads) <= 0.61
    assert 0.60 <= np.mean((every >= 1.0) & (every < 2.0)) <= 0.80
    assert 0.10 <= np.mean((every >= 2.0) & (every < 3.0)) <= 0.30
    assert np.mean(every >= 3.0) < 0.03
    assert 78 <= np.mean([len(d) for d in decels]) <= 121  # Table 8.1


@pytest.mark.parametrize(
    ("v_in", "v_out", "decel", "seconds_off", "count"),
    [
        (20.0, 0.0, 2.0, 0.0, 1),
        (30.0, 20.0, 1.2, 0.0, 1),
        (20.0, 10.0, 2.0, 0.3, 1),  # a short release in the middle
        (20.0, 10.0, 2.0, 3.0, 2),
        (20.0, 19.0, 2.0, 0.0, 0),  # 3.6 km/h are no braking
        (20.0, 10.0, 0.4, 0.0, 0),  # rolling out is none
    ],
)
def test_a_braking_with_constant_deceleration_has_that_mean(
    v_in: float, v_out: float, decel: float, seconds_off: float, count: int
) -> None:
    t = np.arange(0.0, 40.0, 0.01)
    middle = 5.0 + 0.5 * (v_in - v_out) / decel
    a = np.where((t < middle) | (t >= middle + seconds_off), decel, 0.0)
    a[(t < 5.0) | (t >= 5.0 + (v_in - v_out) / decel + seconds_off)] = 0.0
    speed = v_in - np.concatenate([[0.0], np.cumsum(0.01 * a[:-1])])
    one = brakings(t, speed, a)
    assert len(one.start) == count
    if count == 1 and seconds_off == 0.0:
        assert one.mean_decel[0] == pytest.approx(decel, rel=2e-3)
        assert one.speed_in[0] == pytest.approx(v_in, abs=0.03)
        assert one.duration[0] == pytest.approx((v_in - v_out) / decel, abs=0.03)


def test_mean_deceleration_is_by_distance() -> None:
    """1 m/s^2 down to half the lost speed, then 3: v_b^2 - v_e^2 over the distance in between."""
    t = np.arange(0.0, 20.0, 0.001)
    a = np.where(t < 10.0, 1.0, np.where(t < 10.0 + 10.0 / 3.0, 3.0, 0.0))
    speed = 20.0 - np.concatenate([[0.0], np.cumsum(0.001 * a[:-1])])
    distance = (16.0**2 - 10.0**2) / 2.0 + (10.0**2 - 2.0**2) / 6.0
    assert brakings(t, speed, a).mean_decel[0] == pytest.approx(
        (16.0**2 - 2.0**2) / (2.0 * distance), rel=2e-3
    )


def truth(path: Path) -> None:
    """Write a drive that is the trip of seed 1, 1 m/s too fast while it moves, with 1 kW in every brake."""
    trip = real_driving(1)
    speed = trip.speed + (trip.speed > 0.0)
    columns = {"t": trip.t, "vehicle_speed": speed, "grade": trip.grade_by_time()}
    for name in DRIVE_COLUMNS[2:]:
        level = {"bra": 100.0, "whe": -10.0, "dis": 80.0, "mu_": 0.4, "pad": 1.0}[name[:3]]
        columns[name] = np.full(len(trip.t), level)
        if name.startswith("pad"):
            columns[name] = 0.25e-3 * trip.t  # 0.25 g/MJ of 1 kW
    pq.write_table(pa.table(columns), path)


def test_a_drive_is_reported_beside_its_trip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth(tmp_path / "d.truth.parquet")
    drive = read_drive(tmp_path / "d.truth.parquet", DRIVE_COLUMNS, "")
    energy = drive.t[-1] * 1e3 * 1e-6
    assert f"{energy:9.2f}" * 4 in "\n".join(brake_lines(drive))
    assert main([str(tmp_path / "d.truth.parquet"), "--svg", str(tmp_path / "d.svg")]) == 0
    said = capsys.readouterr().out
    assert "1.00 m/s at most" in said
    for line in ("All              front", "Urban            front", "Motorway          rear"):
        assert f"{line}     0.400      0.000        0.250" in said
    brakings = int(said.split("Brakings (printed: Table 8.1, a van)")[1].split()[3].partition(".")[0])
    assert f"0.40 to 0.42{brakings:5d}  {'#' * brakings}\n" in said
    assert said.count("  yes\n") == len(TABLE_1_1)
    assert "disc temperature" in (tmp_path / "d.svg").read_text()


def test_several_drives_have_a_spread(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same trip three times, linings that lose 0.2, 0.25 and 0.3 g/MJ: 2 σ is 0.1 g/MJ."""
    paths = [tmp_path / f"{name}.truth.parquet" for name in "abc"]
    for path, factor in zip(paths, (0.8, 1.0, 1.2), strict=True):
        truth(path)
        table = pq.read_table(path)
        for name in (f"pad_wear_mass_{corner}" for corner in CORNERS):
            place = table.column_names.index(name)
            table = table.set_column(place, name, pa.array(factor * table[name].to_numpy()))
        pq.write_table(table, path)
    assert main(list(map(str, paths))) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 4
    for name, line in zip(("Urban", "Rural", "Motorway"), said[1:], strict=True):
        words = line.split()
        assert words[0] == name
        assert words[2:4] == ["±", "0"]
        assert words[4:] == ["0.250", "±", "0.100", "0.250", "±", "0.100"]


def test_brakings_are_counted_where_they_begin() -> None:
    """200 s at 15 m/s, 100 s at 20 m/s and 100 s at 30 m/s, and no distance that takes time in between."""
    t = np.arange(0.0, 400.5, 1.0)
    speed = np.where(t <= 200.0, 15.0, np.where(t <= 300.0, 20.0, 30.0))
    rows = np.array([(10.0, 5.0, 15.0, 0.0, 1.0), (20.0, 5.0, 16.0, 8.0, 2.0), (390.0, 5.0, 30.0, 25.0, 1.5)])
    discs = np.column_stack([t, t, 2.0 * t, 2.0 * t])
    urban, rural, motorway = (line.split() for line in part_lines(t, speed, discs, Brakings(*rows.T))[1:])
    assert urban == ["Urban", "2", "67", "55.8", "1.50", "15", "30"]  # 2 in 3 km
    assert rural == ["Rural", "0", "0"]
    assert motorway == ["Motorway", "1", "33", "108.0", "1.50", "390", "780"]


def drive_at(path: Path, speed: float) -> Path:
    """Write a drive of 100 s at a constant speed [m/s]."""
    columns = {name: np.full(100, speed if name == "vehicle_speed" else 0.0) for name in DRIVE_COLUMNS}
    pq.write_table(pa.table({"t": np.arange(100.0), **columns}), path)
    return path


def test_a_drive_without_brakings_is_reported_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive = drive_at(tmp_path / "d.parquet", 20.0)
    assert main([str(drive), "--svg", str(tmp_path / "d.svg")]) == 0
    assert "No braking" in capsys.readouterr().out


def test_a_car_that_never_moves_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(drive_at(tmp_path / "d.parquet", 0.0))]) == 2
    assert "vehicle_speed: never above 0" in capsys.readouterr().err


def test_a_seed_below_0_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--seed", "-1"]) == 2
    assert capsys.readouterr().err == "--seed: -1: give a whole number from 0 on\n"


def test_a_file_that_is_no_drive_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pq.write_table(pa.table({"t": [0.0, 1.0]}), tmp_path / "no.parquet")
    assert main([str(tmp_path / "no.parquet")]) == 2
    assert "column vehicle_speed: missing" in capsys.readouterr().err


def test_the_documented_table_is_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--seed", "1"])
    said = capsys.readouterr().out.split("start [s]")[0].rstrip()
    text = (Path(__file__).parents[4] / "docs" / "driving-cycle.md").read_text()
    assert said in text
