"""`identify wear --from-logs`: results of drives to blocks that a rig reads, and what comes back of them."""

import csv
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.identify.friction.sequence import Sequence, load_sequence
from brakelab.identify.wear.applications import FEWEST_APPLICATIONS, ROADS, read_drives, road_blocks, steps_of
from brakelab.identify.wear.from_drives import AGAIN, COUNT, blocks_from_drives
from brakelab.identify.wear.programme import CHECK_OFF, CONTROLLER, mass_of, stops_of
from brakelab.identify.wear.reproduced import LARGEST_ERROR, reproduced
from brakelab.results.brakes import BRAKE_UNITS
from brakelab.results.files import BRAKE_SCHEMA, brakes_path
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

pytestmark = pytest.mark.study

CONFIG = Path(__file__).parents[4] / "config" / "suv.toml"
SLOWED = 600.0  # kg by one front brake
RADIUS = 0.35


def drive(path: Path, seed: int, count: int = 240, **changed) -> Path:
    """Write a result of replay with applications of town, country and motorway; return its path."""
    random = np.random.default_rng(seed)
    rows = []
    for k in range(count):
        v_in = random.choice([12.0, 20.0, 32.0]) * np.exp(0.15 * random.normal())
        v_end = v_in * random.choice([0.02, 0.4, 0.7])
        duration = (v_in - v_end) / random.uniform(0.6, 3.0)
        energy = SLOWED * 0.5 * (v_in**2 - v_end**2) * (1.0 - 0.1 * random.random())  # drag does the rest
        heat = 10.0 + 3.0 * v_in + 8.0 * random.normal()
        for corner in CORNERS:
            row = dict.fromkeys(BRAKE_UNITS, float("nan"))
            row |= {"brake": k, "corner": corner, "learning": "", "left_out": "", "v_in": v_in}
            row |= {"v_end": v_end, "duration": duration, "mu_b_mean": 0.42, "disc_temperature_in": heat}
            row["brake_energy"] = energy * (1.0 + 0.05 * (-1) ** k * (corner[1] == "l"))
            rows.append(row | {name: of(k) for name, of in changed.items()})
    names = [field.name for field in BRAKE_SCHEMA]
    columns = {name: [row.get(name) for row in rows] for name in names}
    pq.write_table(pa.table(columns, schema=BRAKE_SCHEMA), brakes_path(path))
    pq.write_table(pa.table({"t": [0.0]}), path)
    return path


@pytest.fixture
def drives(tmp_path) -> list[Path]:
    return [drive(tmp_path / f"drive{seed}.parquet", seed) for seed in (1, 2)]


def test_blocks_stand_for_the_drives(drives):
    """Work per application within 1 %, speed, deceleration and temperature within what the steps blur."""
    road, left_out = read_drives(drives, "front")
    assert (len(road.energy), left_out) == (480, 0)
    blocks = road_blocks(road, COUNT)
    assert [block.name for block in blocks] == [f"{r}-{h}" for r in ROADS for h in ("gentle", "hard")]
    for block in blocks:
        times = np.array([step.times for step in block.steps])
        assert times.sum() == COUNT
        got = {
            "kinetic": (0.5 * np.array([s.speed_in**2 - s.speed_end**2 for s in block.steps]), 0.02),
            "decel": (np.array([s.decel for s in block.steps]), 0.06),
            "heat": (np.array([s.heat for s in block.steps]), 0.02),
        }
        for name, (values, most) in got.items():
            mean, true = float(times @ values) / COUNT, float(getattr(block.road, name).mean())
            assert abs(mean / true - 1.0) < most, (block.name, name, mean, true)
    gentle, hard = blocks[0].road.decel, blocks[1].road.decel
    assert gentle.max() <= hard.min()


def test_few_applications_are_one_step(drives):
    road, _ = read_drives(drives, "rear")
    steps = steps_of(road.part(np.arange(5)), 10)
    assert [step.times for step in steps] == [10]


def test_files_are_what_a_rig_and_identify_wear_read(drives, tmp_path, capsys):
    out = tmp_path / "blocks.csv"
    blocks_from_drives(drives, CONFIG, "front", out)
    rows = list(csv.DictReader(out.open()))
    assert len(rows) == 9
    assert rows[-1]["block"] == rows[0]["block"] + AGAIN
    assert rows[-1]["programme"] == rows[0]["programme"]
    assert rows[-1]["file"] != rows[0]["file"]
    programme = load_sequence(tmp_path / rows[0]["programme"])
    stops = stops_of(programme)
    assert len(stops) == COUNT
    assert programme.mass == pytest.approx(mass_of(read_drives(drives, "front")[0]), rel=1e-3)
    assert 0.85 * SLOWED < programme.mass < SLOWED
    assert min(stop.heat for stop in stops) >= CHECK_OFF
    table = list(csv.DictReader((tmp_path / "blocks-trip-gentle-stops.csv").open()))
    assert list(table[0]) == list(CONTROLLER)
    assert len(table) == COUNT
    radius = float(table[5]["brake_torque_N_m"]) / (programme.mass * float(table[5]["deceleration_m_s2"]))
    assert radius == pytest.approx(0.36, abs=0.02)
    assert 1.0 < float(table[5]["pressure_bar"]) < 60.0
    assert float(rows[0]["road_energy"]) > 1.0
    assert "ΔE_b" in (tmp_path / "blocks.md").read_text()
    assert "8 blocks of 300" in capsys.readouterr().out


BAD = {
    "an axle that is none": (lambda d: (d, "left", "b.csv"), "--axle: left: choose front or rear"),
    "an output that is no manifest": (lambda d: (d, "front", "b.toml"), "let it end in .csv"),
    "a drive twice": (lambda d: ([d[0], d[0]], "front", "b.csv"), "is given twice"),
    "a log": (lambda d: ([d[0].with_suffix(".log")], "front", "b.csv"), "is no result; `brake-ecu replay"),
    "a result alone": (
        lambda d: (brakes_path(d[0]).unlink(), (d, "front", "b.csv"))[1],
        "drive1.brakes.parquet is not beside it",
    ),
}


@pytest.mark.parametrize(("spoil", "said"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_line(drives, tmp_path, spoil, said):
    chosen, axle, name = spoil(drives)
    with pytest.raises(UserError, match=said) as caught:
        blocks_from_drives(chosen, CONFIG, axle, tmp_path / name)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("b*.toml"))


DIRTY = {
    "no temperature in every second": ({"disc_temperature_in": lambda k: np.nan if k % 2 else 80.0}, 120),
    "no speed": ({"v_in": lambda k: np.nan if k < 40 else 20.0, "v_end": lambda k: 5.0}, 40),
    "a speed of 400 m/s": ({"v_in": lambda k: 400.0 if k == 3 else 20.0, "v_end": lambda k: 5.0}, 1),
    "no time": ({"duration": lambda k: 0.0 if k == 7 else 3.0}, 1),
}


@pytest.mark.parametrize(("changed", "silent"), DIRTY.values(), ids=DIRTY)
def test_applications_that_say_too_little_are_left_out_and_counted(tmp_path, changed, silent):
    road, left_out = read_drives([drive(tmp_path / "d.parquet", 1, **changed)], "front")
    assert left_out == silent
    assert np.isfinite(np.array(road[:5])).all()


def test_a_drive_without_braking_is_refused(tmp_path):
    still = drive(tmp_path / "d.parquet", 1, brake_energy=lambda k: 0.0)
    with pytest.raises(UserError, match=f"front: 0 brake applications .* {FEWEST_APPLICATIONS} or more"):
        read_drives([still], "front")


def rig(stops, random, gain=1.0, mass=SLOWED, ramp=0.3, late=0.0, harder=1.0, missing=(), extra=0):
    """Return recorded stops of a rig whose torque builds up as 1 - exp(-t / ramp)."""
    recorded = []
    for k, stop in enumerate(stops):
        if k in missing:
            continue
        for speed, end in [(stop.speed, stop.end_speed)] + [(28.0, 3.0)] * (k == 5) * extra:
            t = np.arange(0.0, (speed - end) / stop.decel / harder + 3.0 * ramp + late, 0.02)
            build = np.where(t > late, 1.0 - np.exp(-np.maximum(t - late, 0.0) / ramp), 0.0)
            decel = harder * stop.decel * build
            v = speed - 0.02 * np.cumsum(decel)
            keep = v > end
            omega = (gain * v + 0.03 * random.normal(size=len(t))) / RADIUS
            recorded.append({
                "t": t[keep], "omega": omega[keep], "brake_torque": (mass * decel * RADIUS)[keep],
                "disc_temperature": np.full(keep.sum(), stop.heat + 1.0),
            })  # fmt: skip
        if k % 10 == 0:  # a drag that warms the disc
            drag = np.arange(0.0, 5.0, 0.02)
            recorded.append({"t": drag, "omega": np.full(250, 22.0 / RADIUS), "brake_torque": 0 * drag,
                             "disc_temperature": 0 * drag})  # fmt: skip
    return recorded


def asked(tmp_path, drives) -> Sequence:
    blocks_from_drives(drives, CONFIG, "front", tmp_path / "blocks.csv")
    return load_sequence(tmp_path / "blocks-country-hard.toml").model_copy(update={"mass": SLOWED})


RIGS = {
    "as asked, torque builds up in 0.3 s": ({}, "met"),
    "speed 2 % too high": ({"gain": 1.02}, "met"),
    "speed 9 % too high": ({"gain": 1.09}, "ΔE_b by"),
    "a flywheel 10 % too heavy": ({"mass": 1.1 * SLOWED}, "ΔE_b by 3"),
    "20 % harder than asked": ({"harder": 1.2}, "speed by"),
    "20 % softer than asked": ({"harder": 0.8}, "speed by"),
    "0.4 s late, every time": ({"late": 0.4}, "met"),
    "the torque of one pad": ({"mass": 0.5 * SLOWED}, "ΔE_b by 4"),
    "twelve stops missing": ({"missing": range(100, 112)}, "stops by 12"),
    "a stop nobody asked for": ({"extra": 1}, "other stops by 1"),
}


@pytest.mark.parametrize(("errors", "said"), RIGS.values(), ids=RIGS)
def test_a_rig_beside_its_programme(tmp_path, drives, errors, said):
    programme = asked(tmp_path, drives)
    stops = rig(stops_of(programme), np.random.default_rng(3), **errors)
    found = reproduced("b", programme, stops, RADIUS, float("nan"))
    assert re.search(said, found.verdict), found
    assert (found.speed <= LARGEST_ERROR) == ("speed" not in found.verdict)
    assert abs(found.heat - 1.0) < 0.5 or "stops" in found.verdict
    assert np.isnan(found.road)


def test_energy_of_the_road_is_less_than_that_of_a_rig_without_drag(tmp_path, drives):
    programme = asked(tmp_path, drives)
    stops = stops_of(programme)
    work = 1e-6 * sum(0.5 * SLOWED * (s.speed**2 - s.end_speed**2) for s in stops)
    found = reproduced("b", programme, rig(stops, np.random.default_rng(3)), RADIUS, 0.9 * work)
    assert found.road == pytest.approx(10.0, abs=2.5)
