"""`brake-ecu fmu`: what it writes, and what it says where it cannot."""

import json
import platform
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest

from ecu.cli import main
from ecu.settings.resources import resource


@pytest.mark.study
def test_the_same_ecu_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert main(["fmu", "ecu", "--config", "suv", "--out", str(tmp_path / f"{name}.fmu")]) == 0
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.fmu", "b.fmu"]
    assert main(["fmu", "ecu", "--config", "sedan", "--out", str(tmp_path / "b.fmu")]) == 0
    assert (tmp_path / "a.fmu").read_bytes() != (tmp_path / "b.fmu").read_bytes()


def test_it_holds_description_kernels_and_origin(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "vehicle.fmu"
    assert main(["fmu", "vehicle", "stop-1", "--seed", "3", "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["written"] == [str(out)]
    binaries = f"binaries/{platform.machine()}-linux"
    with zipfile.ZipFile(out) as fmu:
        names = fmu.namelist()
        assert names[:2] == ["modelDescription.xml", f"{binaries}/brake_vehicle.so"]
        assert len([name for name in names if name.startswith(f"{binaries}/")]) == 1 + len(
            result["processors"]
        )
        assert json.loads(fmu.read("resources/origin.json"))["initial_speed"] == pytest.approx(33.333)
        assert {one.compress_type for one in fmu.infolist()} <= {zipfile.ZIP_DEFLATED}


def test_a_car_of_a_configuration(tmp_path: Path) -> None:
    words = ["fmu", "vehicle", "stop-1", "--out", str(tmp_path / "vehicle.fmu"), "--plant"]
    assert main([*words, "as-config", "--config", "mustang"]) == 0
    as_config = (tmp_path / "vehicle.fmu").read_bytes()
    assert main([*words, "sedan", "--draw", "nominal"]) == 0
    assert (tmp_path / "vehicle.fmu").read_bytes() != as_config


@pytest.mark.parametrize("name", ["c\x01", "b\udcff", 'Nässe <&> "1"'])
@pytest.mark.study
def test_a_scenario_may_be_called_anything(tmp_path: Path, name: str) -> None:
    scenario, out = tmp_path / f"{name}.toml", tmp_path / "vehicle.fmu"
    scenario.write_bytes(resource("config/scenarios/stop-1.toml").read_bytes())
    assert main(["fmu", "vehicle", str(scenario), "--out", str(out)]) == 0
    with zipfile.ZipFile(out) as fmu:
        description = ET.fromstring(fmu.read("modelDescription.xml")).get("description", "")
    assert description.endswith(f"{name}.toml" if name.isprintable() else f"{name[0]}?.toml")


WRONG = {
    "no such scenario": (["vehicle", "stop-99", "--out", "a.fmu"], "stop-99: no such file"),
    "no FMU's name": (
        ["ecu", "--config", "suv", "--out", "a.zip"],
        "a.zip: importers know an FMU",
    ),
    "no car": (["vehicle", "stop-1", "--plant", "as-config", "--out", "a.fmu"], "as-config: of which car?"),
    "frames": (["vehicle", "lost", "--out", "a.fmu"], 'lost: fault: "lost" acts on frames'),
    "another car": (
        ["vehicle", "stop-1", "--config", "suv", "--out", "a.fmu"],
        "--config: suv: is the car of --plant as-config",
    ),
    "in a file": (
        ["ecu", "--config", "suv", "--out", f"{__file__}/a.fmu"],
        "test_command.py/a.fmu: cannot be written",
    ),
    "nowhere": (["ecu", "--config", "suv", "--out", "/proc/a.fmu"], "/proc/a.fmu: cannot be written"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_one_line(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words, expected = WRONG[case]
    assert main(["fmu", *words]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert len(said.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_a_c_compiler_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    assert main(["fmu", "ecu", "--config", "suv", "--out", str(tmp_path / "a.fmu")]) == 2
    assert "no-such-compiler: " in (said := capsys.readouterr().err)
    assert "install a C compiler, or set CC to one" in said
