"""Many cars: which are driven, which is the worst, and the error of a wrong `--vary`."""

import json
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pyarrow.parquet as pq
import pytest

from brakelab.rig.vary import Run, car_text, cars, span, worst
from brakelab.rig.verdicts import Verdict
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.vehicle_bus import new_vehicle
from ecu import cli
from ecu.errors import UserError

pytestmark = pytest.mark.usefixtures("undrawn")

STOP = """
plant = "suv"
draw = "nominal"
initial_speed = 8.0
phase = [{ kind = "brake", decel = 4.0, until_speed = 0.0 }]
expect = [{ what = "stopping_distance", at_most = 9.9 }, { what = "no_bit", bit = "wheel slips" }]
"""


def test_ranges_are_drawn_evenly_and_combined_with_every_list() -> None:
    spans = [span("mass=1600..2400"), span("friction_scale_front=80,100 %"), span("cog_height=0.6,0.7")]
    found = cars(spans, 8, 0)
    assert len(found) == 8 * 2 * 2
    masses = sorted({float(car["mass"]) for car in found})
    assert [int((mass - 1600) // 100) for mass in masses] == list(range(8))  # one in each eighth
    assert {(car["friction_scale_front"], car["cog_height"]) for car in found} == {
        (friction, height) for friction in ("80 %", "100 %") for height in (0.6, 0.7)
    }
    assert cars(spans, 8, 0) == found != cars(spans, 8, 1)
    assert cars([span("mass=1600,2400")], 8, 0) == [{"mass": 1600.0}, {"mass": 2400.0}]


def test_the_worst_is_the_run_nearest_to_its_limit_or_furthest_beyond() -> None:
    margins = {1700.0: 0.5, 1800.0: -2.0, 1900.0: -1.0}
    runs = [
        Run("stop", {"mass": mass}, Verdict("short", f"{40 - margin} m", margin >= 0.0, margin))
        for mass, margin in margins.items()
    ]
    runs += [Run("stop", {"mass": mass}, Verdict("calm", "never", True)) for mass in margins]
    failed, calm = worst(runs).rows
    assert failed == ("stop", "short", "2 of 3", "42.0 m", "mass = 1800.0")
    assert calm[2] == "0 of 3"


@pytest.mark.parametrize(
    ("given", "values"),
    [
        ("free_radius=0.351234567", [0.351234567]),
        ("mass=1e3,1234.5 %", ["1000 %", "1234.5 %"]),
        ("cooling=20000,1e-5 %", ["20000 %", "1e-05 %"]),
        ("cooling=1e-6..2e-6%", None),
        ("cooling=20000..99999%", None),
    ],
)
def test_what_a_list_names_is_driven_and_every_value_is_one_of_a_scenario(
    given: str, values: list[float | str] | None
) -> None:
    found = cars([span(given)], 5, 0)
    if values is not None:
        assert [next(iter(car.values())) for car in found] == values
    for car in found:
        new_vehicle(Scenario.model_validate(tomllib.loads(STOP) | {"car": car}), 0)


def test_a_car_is_said_as_a_scenario_takes_it() -> None:
    assert car_text({"mass": 1800.0, "heating": "80 %"}) == 'mass = 1800.0, heating = "80 %"'


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("mas=1..2", "mas: no parameter of a car; did you mean mass"),
        ("mass", "give NAME=LOW..HIGH or NAME=A,B,C"),
        ("mass=1600-2400", "give NAME=LOW..HIGH or NAME=A,B,C"),
        ("mass=2400..1600", "give the lower number first"),
        ("mass=0,1600", "give finite numbers above 0"),
        ("mass=1e400", "give finite numbers above 0"),
        ("mass=1..1e400", "give finite numbers above 0"),
    ],
)
def test_a_wrong_range_is_one_line(given: str, message: str) -> None:
    with pytest.raises(UserError) as caught:
        span(given)
    assert str(caught.value).startswith(f"--vary: {given}: {message}")


def test_a_parameter_is_varied_once() -> None:
    with pytest.raises(UserError, match="a parameter is given twice"):
        cars([span("mass=1..2"), span("mass=3")], 1, 0)


def rig(tmp_path: Path, *arguments: str) -> int:
    (tmp_path / "stop.toml").write_text(STOP)
    command = ["rig", str(tmp_path / "stop.toml"), "--config", "suv", "--out", str(tmp_path / "out")]
    return cli.main([*command, *arguments])


def test_the_run_that_fails_is_named_with_its_car(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without its nominal friction this first stop is too long: nothing is learned yet."""
    junit = tmp_path / "vary.xml"
    varied = ("--lock-step", "--vary", "friction_scale=60,100%", "--junit", str(junit), "--json")
    assert rig(tmp_path, *varied) == 1
    (table,) = json.loads(capsys.readouterr().out)["tables"]
    scenario, expected, failed, found, car = table["rows"][0]
    assert (scenario, expected) == ("stop", "stopping distance at most 9.9 m")
    assert (failed, car) == ("1 of 2", 'friction_scale = "60 %"')
    assert float(found.removesuffix(" m")) > 9.9

    (suite,) = ElementTree.parse(junit).getroot()
    assert suite.attrib == {"name": "stop", "tests": "4", "failures": "1", "errors": "0"}
    (case,) = [case for case in suite if len(case)]
    assert case.get("name") == f"{expected}; {car}"

    rows = pq.read_table(tmp_path / "out/vary.parquet").to_pylist()
    assert [(row["friction_scale"], row["passed"]) for row in rows if row["expected"] == expected] == [
        ("60 %", False),
        ("100 %", True),
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--runs", "9", "--lock-step"), "--runs: 9: draws from the ranges of --vary; give one"),
        (("--runs", "9", "--lock-step", "--vary", "mass=2000"), "--runs: 9: draws from the ranges of --vary"),
        (("--lock-step", "-i", "virtual", "-c", "x"), "-i, -c: --lock-step drives in memory; leave one out"),
        (("--vary", "mass=1..2"), "--vary: drives in memory; add --lock-step"),
        (("--vary", "mass=5..2", "--lock-step"), "--vary: mass=5..2: give the lower number first"),
        (("--vary", "mass=1.9", "--lock-step"), "[car]: mass = 1.9: the drawn car has 2"),
    ],
)
def test_what_does_not_fit_is_refused(
    arguments: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert rig(tmp_path, *arguments) == 2
    assert message in capsys.readouterr().err


def test_verdicts_are_not_written_over_the_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    junit = str(tmp_path / "out/vary.parquet")
    assert rig(tmp_path, "--lock-step", "--vary", "mass=1900", "--junit", junit) == 2
    assert f"--junit: {junit}: has the runs themselves" in capsys.readouterr().err


def test_a_folder_in_the_place_of_the_results_is_refused_before_the_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out/vary.parquet").mkdir(parents=True)
    assert rig(tmp_path, "--lock-step", "--vary", "mass=1900") == 2
    message = capsys.readouterr()
    assert "--out" in message.err
    assert "which is a folder" in message.err
    assert "worst" not in message.out


def test_a_scenario_that_expects_nothing_is_not_driven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["rig", "stop-1", "--config", "suv", "--out", str(tmp_path), "--lock-step"]
    assert cli.main([*arguments, "--vary", "mass=1900..2100"]) == 2
    assert "judges runs by [[expect]], add one" in capsys.readouterr().err
