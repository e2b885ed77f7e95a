"""Which drives of which vehicles a pattern or a manifest names, and in which order."""

from pathlib import Path

import pytest

from brakelab.fleet.manifest import VehicleDrive, find_drives
from ecu.errors import UserError
from ecu.settings.resources import resource

SUV, SEDAN = resource("config/suv.toml"), resource("config/sedan.toml")
KONA = resource("config/maps/kona.toml")


def names(drives: list[VehicleDrive]) -> list[str]:
    return [f"{drive.vehicle}/{drive.name}" for drive in drives]


def test_by_pattern_the_folder_is_the_vehicle_and_numbers_count_as_numbers(tmp_path: Path) -> None:
    for name in ("car-2/drive-10.log", "car-2/drive-9.log", "car-10/a.log", "out/brakes/vehicle=x/a.log"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    out = tmp_path / "out"
    found = find_drives([f"{tmp_path}/**/*.log"], SUV, None, out)
    assert names(found) == ["car-2/drive-9.log", "car-2/drive-10.log", "car-10/a.log"]
    one_by_one = [str(tmp_path / name) for name in ("car-10/a.log", "car-2/drive-9.log")]
    assert names(find_drives(one_by_one, SUV, None, out)) == ["car-10/a.log", "car-2/drive-9.log"]


def test_csv_orders_by_time(tmp_path: Path) -> None:
    manifest = tmp_path / "FLEET.CSV"
    manifest.write_text(
        "vehicle,log,time,config,map\n"
        "b,late.log,2026-05-02T08:00:00+02:00,sedan,kona\n"
        "b,early.log;early-2.log,2026-05-02T05:59:59Z,,\n"
        "a,/data/x.log,2026-05-03,,\n"
    )
    found = find_drives([str(manifest)], SUV, None, tmp_path)
    assert names(found) == ["b/early.log", "b/late.log", "a/x.log"]
    assert found[0].logs == (str(tmp_path / "early.log"), str(tmp_path / "early-2.log"))
    assert [(drive.config, drive.map) for drive in found] == [(SUV, None), (SEDAN, KONA), (SUV, None)]


def test_toml_is_in_the_order_of_driving(tmp_path: Path) -> None:
    manifest = tmp_path / "Fleet.TOML"
    manifest.write_text(
        '[[vehicle]]\nname = "a"\nconfig = "sedan"\ndrives = ["2.log", ["1a.log", "1b.log"], "s3://d/3.log"]\n'
        '[[vehicle]]\nname = "b"\ndrives = ["1.log"]\n'
    )
    found = find_drives([str(manifest)], SUV, KONA, tmp_path)
    assert names(found) == ["a/2.log", "a/1a.log", "a/3.log", "b/1.log"]
    assert found[1].logs == (str(tmp_path / "1a.log"), str(tmp_path / "1b.log"))
    assert found[2].logs == ("s3://d/3.log",)
    assert [drive.config for drive in found] == [SEDAN, SEDAN, SEDAN, SUV]
    assert found[0].map == KONA


WRONG = {
    "nothing.log": ("", r"nothing\.log: no log has such a name"),
    "a.csv": ("car,log\na,1.log\n", r"a\.csv: line 1: column vehicle is missing"),
    "b.csv": ("vehicle,log\na,1.log\n,2.log\n", r"b\.csv: line 3: vehicle or log is missing"),
    "c.csv": ("vehicle,log,time\na,1.log,noon\n", r"c\.csv: line 2, time: 'noon' is no time"),
    "d.csv": ("vehicle,log\na,x/1.log\na,y/1.log\n", r"1\.log: two drives of vehicle a have this name"),
    "e.csv": ("vehicle,log\n", r"e\.csv: line 2: no drive"),
    "a.toml": ('[[vehicle]]\nname = "a"\n', r"a\.toml: vehicle\.1\.drives: missing"),
    "b.toml": ('[[vehicle]]\nname = "a"\ndrives = []\n', r"b\.toml: vehicle\.1\.drives: give at least 1"),
    "c.toml": ("vehicle = 3\n", r"c\.toml: vehicle: "),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_one_line(name: str, tmp_path: Path) -> None:
    content, line = WRONG[name]
    if content:
        (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=line) as caught:
        find_drives([str(tmp_path / name)], SUV, None, tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_a_vehicle_needs_a_configuration(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("vehicle,log\na,1.log\n")
    with pytest.raises(UserError, match="vehicle a has no configuration; give --config"):
        find_drives([str(tmp_path / "a.csv")], None, None, tmp_path)
