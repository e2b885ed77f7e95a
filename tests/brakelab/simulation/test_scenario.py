"""Scenario files: the shipped ones, and one line for every mistake."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.records import BRAKE, CRUISE
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.scenario_car import scenario_plant
from ecu import cli
from ecu.errors import UserError

CONFIG = Path(__file__).parents[3] / "config" / "scenarios"
GOOD = """
plant = "suv"
initial_speed = 20.0
[[phase]]
kind = "brake"
decel = 4.0
until_speed = 0.0
"""

FOLLOW = """
plant = "suv"
initial_speed = 0.0
[[phase]]
kind = "follow"
"""
CRUISE_TO_20 = (
    GOOD.replace('"brake"', '"cruise"').replace("decel = 4.0", "speed = 20.0").replace("= 0.0", "= 20.0")
)


@pytest.mark.parametrize(
    ("number", "decel", "friction"), [(1, 4.0, 1.2), (2, 7.0, 1.2), (3, 4.0, 0.7), (4, 6.0, 0.7)]
)
def test_stops_are_those_of_table_4_2(number: int, decel: float, friction: float) -> None:
    scenario = load_scenario(CONFIG / f"stop-{number}.toml")
    script = scenario.script()
    assert scenario.initial_speed == pytest.approx(120 / 3.6, abs=1e-3)
    assert list(script.phases["kind"]) == [CRUISE, BRAKE, BRAKE]
    assert script.phases["seconds"][0] == 6.0
    assert list(script.phases["decel"][1:]) == [decel, decel]
    assert np.array_equal(script.road_friction, [[0.0, friction]])
    assert not scenario.blending


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_scenario_names_a_car_that_exists(path: Path) -> None:
    scenario = load_scenario(path)
    assert scenario_plant(scenario).name == scenario.plant


@pytest.mark.parametrize("value", ["1.0", "[[0.0, 1.2], [3.0, 0.7]]"])
def test_road_friction_is_a_number_or_a_table_over_time(tmp_path: Path, value: str) -> None:
    path = tmp_path / "s.toml"
    path.write_text(f"road_friction = {value}\n{GOOD}")
    table = load_scenario(path).script().road_friction
    assert table.shape == (2 if "[" in value else 1, 2)


def test_a_road_may_be_described_by_place(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(GOOD + "[road]\nfriction = [[0.0, 1.2, 0.2]]\nbank = [[0.0, 0.0], [90.0, 0.05]]\n")
    road = load_scenario(path).script().road
    assert np.array_equal(road.friction, [[0.0, 1.2, 0.2]])
    assert np.array_equal(road.bank, [[0.0, 0.0], [90.0, 0.05]])
    assert (len(road.height), len(road.grade)) == (0, 0)


def test_every_mistake_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n[[phase]]\nkind = "coast"\nseconds = -1.0\n')
    assert cli.main(["vehicle", str(path), "-i", "virtual", "-c", "x"]) == 2
    said = [line.removeprefix(f"brake-ecu: {path}: ") for line in capsys.readouterr().err.splitlines()]
    places = [line.partition(": ")[0] for line in said]
    assert sorted(places) == ["initial_speed", "name", "phase.1.seconds", "plant"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            GOOD.replace("initial_speed", "initial_spede"),
            "initial_spede: unknown key; did you mean initial_speed?",
        ),
        (GOOD + "colour = 3\n", "phase.1.colour: unknown key"),
        (GOOD.replace('"brake"', '"skid"'), "phase.1.kind"),
        (GOOD.replace("until_speed = 0.0", ""), "never ends; give until_speed or seconds"),
        (GOOD.replace("decel = 4.0", ""), "one of decel, pedal and kept_decel"),
        (GOOD.replace("decel = 4.0", "decel = inf"), "finite number"),
        (GOOD + "pedal = 20.0\n", "one of decel, pedal and kept_decel"),
        (GOOD + "speed = 20.0\n", "speed belongs to a cruise phase"),
        (GOOD.replace('"brake"', '"cruise"'), "speed belongs to a cruise phase"),
        ("road_friction = [[1.0, 1.2], [0.5, 0.7]]" + GOOD, "rows of rising time"),
        ("road_friction = -1.0" + GOOD, "mine.toml: road_friction: give values above 0"),
        (GOOD + "[road]\nfriction = [[1.0, 1.2, 1.2], [0.5, 0.7, 0.7]]", "rows of rising distance"),
        (GOOD + "[road]\nfriction = [[1.0, 1.2, 0.0]]", "values above 0"),
        (GOOD + "[road]\nfriction = [[1.0, 1.2]]", "road.friction.1"),
        ("grade = 0.1" + GOOD + "[road]\ngrade = [[0.0, 0.1]]", "either grade (by time) or road.grade"),
        ("road_friction = 0.5" + GOOD + "[road]\nfriction = [[0.0, 1.0, 1.0]]", "either road_friction"),
        (GOOD.split("[[phase]]")[0], "phase: missing"),
        ('road_friction = "wet"' + GOOD, "road_friction.1.2: give a number (found 'wet')"),
        ("wetness = 1.5" + GOOD, "wetness: give a value of at most 1"),
        ("repeat = 0" + GOOD, "repeat: give a value of at least 1"),
        ("charge_limit = [[1.0, 1e5], [0.5, 0.0]]" + GOOD, "charge_limit: give rows of rising time"),
        ("charge_limit = -1.0" + GOOD, "charge_limit: give values of at least 0"),
        ("motor_share = 0.5\nblending = true" + GOOD, "either blending (by the ECU) or motor_share"),
        (GOOD + "pedal_speed = 0.0", "phase.1.pedal_speed: give a value above 0"),
        (GOOD + "kept_decel = 3.0", "one of decel, pedal and kept_decel"),
        (GOOD + "[tyre_fault]\ntime = 4.0", "tyre_fault.stiffness: missing"),
        (GOOD + "[steering]\nangle = [[0.0, 0.0]]\npath = [[0.0, 0.0]]", "either angle (by time) or path"),
        (GOOD + "[steering]\npath = [[2.0, 0.0], [1.0, 0.0]]", "path: give rows of rising distance"),
        (GOOD + "[trace]\nspeed = [[0.0, 0.0], [1.0, 1.0]]", "a follow phase needs [trace]"),
        (FOLLOW, "a follow phase needs [trace]"),
        (FOLLOW + "[trace]", "trace: give one of speed, file and generate"),
        (FOLLOW + "[trace]\nspeed = [[0.0, 0.0]]", "rows of rising time from 0.0 on"),
        (FOLLOW + "[trace]\nspeed = [[0.0, 0.0], [1.0, 1.0]]\nseed = 1", "seed belongs to generate"),
        (FOLLOW + '[trace]\ngenerate = "wltp-brake"\nseed = 1', "seed belongs to generate"),
        (FOLLOW + '[trace]\ngenerate = "real-driving"\ntrip = 1', "trip belongs to generate"),
        (
            FOLLOW + '[trace]\ngenerate = "wltp-brake"\ntrip = 11',
            "trace.trip: give a value of at most 10 (found 11)",
        ),
        ("grade = 0.1" + FOLLOW + '[trace]\ngenerate = "real-driving"', "a generated trace has its own"),
        (CRUISE_TO_20, "until_speed is never passed; give a speed beyond it"),
        ("x = = 1", "not valid TOML"),
    ],
)
def test_a_mistake_is_one_line_that_names_file_and_key(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        load_scenario(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_scenario_gives_its_car_an_engine_and_a_payload(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    engine = "[engine]\ndrag_torque = 25.0\nlowest_speed = 126.0\nratios = [14.8, 6.6]\nshare_front = 1.0\n"
    path.write_text(f"{GOOD}{engine}[payload]\nmass = 100.0\nbehind = 0.5\nheight = 0.6\n")
    vehicle = scenario_plant(load_scenario(path)).vehicle
    assert vehicle.engine is not None
    assert vehicle.engine.ratios == (14.8, 6.6)
    assert vehicle.body.mass == 2205.0


def test_the_phases_are_driven_as_often_as_repeat_says(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text("repeat = 3\n" + GOOD.replace("until_speed = 0.0", "seconds = 1.0\npedal_speed = 45.0"))
    phases = load_scenario(path).script().phases
    assert len(phases) == 3
    assert list(phases["pedal_rate"]) == [50.0] * 3


def test_an_unknown_car_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace('"suv"', '"lorry"'))
    with pytest.raises(UserError, match="lorry"):
        scenario_plant(load_scenario(path))
