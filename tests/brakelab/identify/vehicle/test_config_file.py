"""The CONFIG and the map that are written: includes, what is identified, what is out of range, offsets."""

import tomllib
from pathlib import Path

import pytest

from brakelab.identify.vehicle.config_file import map_toml, offsets, unit_scales, write_vehicle
from brakelab.identify.vehicle.parameters import Parameter
from brakelab.identify.vehicle.solve import Zeros
from ecu.contract.params import GRAVITY
from ecu.errors import UserError
from ecu.settings.config import load_config

from .example import SUV

MASS = Parameter("vehicle.mass", "kg", 2105.0, 1990.0, 20.0, 300, "motor torque", "")
STIFF = Parameter("front.slip_stiffness", "-", 22.0, 24.5, 2.0, 300, "slip", "")
LEFT = Parameter("rear.mu_nominal", "-", 0.45, 0.45, 0.1, 0, "brakes", "brakings")


def written(tmp_path, start: Path, *parameters: Parameter):
    out = tmp_path / "cars" / "mine.toml"
    kept = write_vehicle(start, out, parameters, load_config(start), ["a.log"], "2 brake applications")
    return load_config(out), out.read_text("utf-8"), kept


def test_fitted_keys_are_written_and_the_rest_is_start(tmp_path):
    start = load_config(SUV)
    car, text, _ = written(tmp_path, SUV, MASS, STIFF, LEFT)
    assert (car.vehicle.mass, car.front.slip_stiffness) == (1990.0, 24.5)
    assert car.rear == start.rear
    assert car.control == start.control
    assert "mass = 1990 # kg, ± 20; motor torque; 300 half seconds; was 2105" in text
    assert "slip_stiffness = 24.5 # ± 2, rough" in text
    assert "# rear.mu_nominal = 0.45 -: needs brakings" in text
    assert "# 2 brake applications\n" in text


def test_a_start_that_includes_another_is_written_out(tmp_path):
    (tmp_path / "base.toml").write_text(SUV.read_text("utf-8"), encoding="utf-8")
    start = tmp_path / "start.toml"
    start.write_text(
        'include = "base.toml"\nname = "mine"\n[vehicle]\nmass = 2200.0\ntrack = 1.6\n'
        "[front]\nmu_nominal = 0.4\n"
        "[front.pad]\nthickness_new = 11.0\n[observer]\nmin_speed = 5.0\n",
        encoding="utf-8",
    )
    car, _, _ = written(tmp_path, start, MASS)
    own = load_config(start)
    assert car.vehicle == own.vehicle.model_copy(update={"mass": 1990.0})
    assert (car.name, car.front, car.observer) == ("mine", own.front, own.observer)


def test_a_mass_beyond_the_laden_one_takes_it_along(tmp_path):
    car, _, _ = written(tmp_path, SUV, MASS._replace(value=2700.0))
    assert car.vehicle.laden_mass == pytest.approx(2700.0)


def test_a_value_out_of_range_is_left_at_start(tmp_path):
    car, text, kept = written(tmp_path, SUV, MASS, STIFF._replace(value=400.0))
    assert (car.vehicle.mass, car.front.slip_stiffness) == (1990.0, 22.0)
    assert "400 is out of range" in text
    assert kept[1].remedy


def test_an_out_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "cars").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        written(tmp_path, SUV, MASS)


def test_zeros_that_are_sure_become_offsets_of_the_map(tmp_path):
    zeros = Zeros((-0.07, 0.01), (0.02, 0.01), (0.004, 0.01), [("calliper_pressure_fl", 0.4, 0.02)])
    assert offsets(zeros) == {"accel_x": -0.07, "calliper_pressure_fl": 0.4}
    source = tmp_path / "maps" / "car.toml"
    source.parent.mkdir()
    source.write_text(
        'database = "../car.dbc"\n[inputs]\n'
        'accel_x = { message = "A", signal = "X", offset = -0.45, timeout = 0.2 }\n'
        'calliper_pressure_fl = { message = "B", signal = "P" }  # bar\n'
        'calliper_pressure_fr = { message = "B" }\n'
    )
    text = map_toml(source, tmp_path / "mine-map.toml", offsets(zeros), dict.fromkeys(offsets(zeros), 1.0))
    assert tomllib.loads(text) == {
        "database": "car.dbc",
        "inputs": {
            "accel_x": {"message": "A", "signal": "X", "offset": -0.38, "timeout": 0.2},
            "calliper_pressure_fl": {"message": "B", "signal": "P", "offset": -0.4},
            "calliper_pressure_fr": {"message": "B"},
        },
    }
    assert "  # bar" in text


def test_a_zero_is_taken_off_in_the_unit_of_the_map(tmp_path):
    (tmp_path / "drive.csv").write_text("t [s],ax [g],p [bar],yaw [deg/s]\n0,1,2,3\n0.1,1,2,3\n")
    columns = tmp_path / "columns.toml"
    columns.write_text(
        'time = "t"\n[inputs]\naccel_x = { column = "ax", factor = -1, offset = 0.01 }\n'
        'yaw_rate = { column = "yaw" }\ncalliper_pressure_fl = { column = "p", unit = "MPa" }\n'
    )
    (tmp_path / "car.dbc").write_text(
        'VERSION ""\nBS_:\nBU_: X\nBO_ 1 A: 8 X\n SG_ AX : 0|16@1- (0.001,0) [0|0] "g" X\n'
        ' SG_ P : 16|16@1- (0.1,0) [0|0] "kPa" X\n SG_ YAW : 32|16@1- (0.01,0) [0|0] "deg/s" X\n'
    )
    frames = tmp_path / "frames.toml"
    frames.write_text(
        'database = "car.dbc"\n[inputs]\naccel_x = { message = "A", signal = "AX", offset = 0.01 }\n'
        'yaw_rate = { message = "A", signal = "YAW" }\n'
        'calliper_pressure_fl = { message = "A", signal = "P", unit = "MPa" }\n'
    )
    zeros = {"accel_x": 0.5 * GRAVITY, "yaw_rate": 0.01, "calliper_pressure_fl": 0.3}
    for source in (columns, frames):
        text = map_toml(source, tmp_path / "own.toml", zeros, unit_scales(source, tmp_path / "drive.csv"))
        own = {name: one["offset"] for name, one in tomllib.loads(text)["inputs"].items()}
        expected = {"accel_x": -0.49, "yaw_rate": -0.57296, "calliper_pressure_fl": -0.03}
        assert own == pytest.approx(expected, rel=1e-3)
