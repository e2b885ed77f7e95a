"""`config new`: the shipped cars come out again from data sheets; what is missing or wrong is reported."""

import io
from pathlib import Path

import pytest

from ecu import cli
from ecu.settings.config import load_config
from ecu.settings.new import CARS, config_text, nearest, parse_given
from ecu.settings.resources import resource
from ecu.settings.toml_file import Section

TYRES = {"suv": "235/55 R19", "sedan": "275/40 R19", "lcv": "255/45 R18"}
SHEET = [
    "name=hatchback",
    "vehicle.mass=1.4 t",
    "vehicle.wheelbase=2620",
    "vehicle.front_load=850 kg",
    "front.tyre=205/55 R16",
    "front.calliper=floating",
    "front.pistons=1",
    "front.piston_diameter=57",
    "front.disc_diameter=288",
    "rear.tyre=205/55 R16",
    "rear.calliper=floating",
    "rear.pistons=1",
    "rear.piston_diameter=38",
    "rear.effective_radius=113",
]


def run(out: Path, *given: str) -> int:
    return cli.main(["config", "new", "--out", str(out), *(word for one in given for word in ("--set", one))])


@pytest.mark.parametrize("name", CARS)
def test_a_shipped_car_comes_out_of_its_data_sheet(name: str, tmp_path: Path) -> None:
    """Its figures of Appendix D, with the load on the front axle in place of the centre of gravity."""
    car = load_config(resource(f"config/{name}.toml"))
    vehicle = car.vehicle
    load = vehicle.mass * (1.0 - vehicle.front_axle / vehicle.wheelbase)
    given = [
        f"vehicle.mass={vehicle.mass}",
        f"vehicle.wheelbase={vehicle.wheelbase} m",
        f"vehicle.front_load={load}",
        f"vehicle.laden_mass={vehicle.laden_mass}",
    ]
    for axle in ("front", "rear"):
        brake = getattr(car, axle)
        given += [
            f"{axle}.tyre={TYRES[name]}",
            f"{axle}.calliper=fixed",
            f"{axle}.pistons={2 * brake.pistons}",
            f"{axle}.piston_diameter={brake.piston_diameter} m",
            f"{axle}.effective_radius={brake.effective_radius} m",
        ]
    out = tmp_path / "car.toml"
    assert run(out, *given) == 0
    made = load_config(out)
    assert made.control == car.control
    assert made.sensors == car.sensors
    for section in ("vehicle", "front", "rear"):
        for key, value in getattr(car, section):
            if isinstance(value, Section):  # linings stay the usual ones
                continue
            found = getattr(getattr(made, section), key)
            assert found == (pytest.approx(value, rel=1e-3) if isinstance(value, float) else value), key


def test_the_file_passes_the_check_and_names_the_origin_of_every_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "car.toml"
    assert run(out, *SHEET) == 0
    said = capsys.readouterr().out
    assert f"next: brake-ecu config check {out}" in said
    assert "identify vehicle" in said
    assert cli.main(["config", "check", str(out)]) == 0
    lines = [line for line in out.read_text("utf-8").splitlines() if " = " in line]
    assert all("#" in line for line in lines[1:])
    assert sum("; data sheet" in line for line in lines) == 5
    car = load_config(out)
    assert car.vehicle.front_axle == pytest.approx(2.62 * (1.0 - 850.0 / 1400.0), abs=1e-3)
    assert car.front.effective_radius == pytest.approx((0.288 - 0.057) / 2)


def test_everything_that_is_missing_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path / "car.toml", "vehicle.mass=1400", "vehicle.wheelbase=2620") == 2
    said = capsys.readouterr().err
    assert "missing: vehicle.front_load [kg] or vehicle.front_axle [mm], front.tyre, front.calliper" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "car.toml").exists()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("wheels=4", "--set: wheels=4: give KEY=VALUE with a KEY of name, vehicle.mass"),
        ("vehicle.mass", "give KEY=VALUE"),
        ("vehicle.front_load=1300", "1300 kg of 1400 kg is no axle load of a car"),
        ("vehicle.laden_mass=1200", "vehicle: laden_mass must not be smaller than mass"),
    ],
)
def test_a_contradiction_is_one_line(
    given: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path / "car.toml", *SHEET, given) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "car.toml").exists()


def test_an_odd_number_of_pistons_is_none_of_a_fixed_calliper(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path / "car.toml", *SHEET, "front.calliper=fixed", "front.pistons=3") == 2
    assert "front.pistons: a fixed calliper has as many pistons on both sides" in capsys.readouterr().err


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "car.toml"
    out.write_text("mine", "utf-8")
    assert run(out, *SHEET) == 2
    assert "exists; give another name" in capsys.readouterr().err
    assert out.read_text("utf-8") == "mine"


def test_hydraulic_brakes_share_by_their_levers(tmp_path: Path) -> None:
    answers = parse_given([*SHEET, "brakes=hydraulic", "motors=front"])
    text = config_text(answers, nearest(answers))
    # A_k r_eff, the same tyres and linings: 57² · 115.5 to 38² · 113
    share = 57**2 * 115.5 / (57**2 * 115.5 + 38**2 * 113)
    assert f"front_share = {share:.3f}" in text
    assert "[blending]" in text
    assert "front = 0.7\nrear = 0.0" in text


def test_questions_are_asked_until_they_are_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Enter takes the nearest car's; a wrong answer is asked again; a known load needs no alternative."""
    brake = ["205/55 R16", "floating", "1", "57", "", "288", ""]
    said = ["", "1400", "2.62", "2620", "850", "", "", "", "", "", "", *brake, *brake, "", ""]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(said) + "\n"))
    out = tmp_path / "car.toml"
    assert run(out) == 0
    printed = capsys.readouterr().out
    assert "did you mean 2.62 m?" in printed
    assert "Centre of gravity behind the front axle" not in printed
    assert load_config(out).vehicle.wheelbase == pytest.approx(2.62)


def test_what_enter_takes_is_another_car_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    brake = ["235/55 R19", "", "", "", "", "305", ""]
    said = ["", "", "2665", "1120", *[""] * 6, *brake, *brake, "", ""]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(said) + "\n"))
    out = tmp_path / "car.toml"
    run(out)
    origin = {
        line.split(" = ")[0]: line.rpartition("; ")[2]
        for line in out.read_text("utf-8").splitlines()
        if " = " in line
    }
    assert origin["wheelbase"] == "data sheet"
    assert origin["mass"] == origin["piston_diameter"] == "as suv, assumed"
    assert origin["pistons"] == "floating calliper, as suv, assumed"


def test_an_end_of_input_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("hatchback\n1400\n"))
    assert run(tmp_path / "car.toml") == 2
    assert "missing: vehicle.wheelbase [mm]" in capsys.readouterr().err
