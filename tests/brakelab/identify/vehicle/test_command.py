"""`brake-ecu identify vehicle`: a simulated car from START 20 % off, and what bad input gives."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.identify.vehicle.command import identify_vehicle
from brakelab.identify.vehicle.page import overrun_table, panels_of
from brakelab.identify.vehicle.parameters import free_radius, parameters_of, values_of
from brakelab.identify.vehicle.reader import read_drives
from brakelab.identify.vehicle.solve import identify
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.configured import shipped
from brakelab.simulation.simulate import write_columns
from brakelab.studies.accuracy.vehicle import start_of, true_theta, with_parameters
from ecu.algorithm.vehicle import rolling_radius
from ecu.errors import UserError
from ecu.settings.config import load_config, new_params

from .example import SUV

pytestmark = pytest.mark.study

SEED = 3


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """Return the drive of a car of the wide draw, its file, and its true parameters."""
    loop = new_loop(shipped("identify"), load_config(SUV), SEED)
    known = loop.sides.vehicle.params[0].copy(), loop.sides.vehicle.sensors.copy()
    drive = run(loop)
    path = tmp_path_factory.mktemp("identify") / "drive.parquet"
    write_columns(path, drive.t, drive.inputs, {})
    return drive, path, known


@pytest.fixture(scope="module")
def found(car):
    params = new_params(start_of(SEED))
    return identify(read_drives([car[1]], params, None), params, closed=True)


def test_a_car_is_identified_from_a_start_20_percent_off(car, found):
    start = start_of(SEED)
    parameters = parameters_of(found, start)
    drive, _, (plant, sensors) = car
    used = {one.key: one.value for one in parameters}
    theta = true_theta(
        plant, drive, sensors, [used[f"{axle}.push_out_pressure"] for axle in ("front", "rear")]
    )
    true = values_of(found, start, theta) | {"vehicle.track": float(plant["track"])}
    identified = [one for one in parameters if not one.remedy]
    assert {"vehicle.mass", "vehicle.drag_coefficient", "front.mu_nominal", "rear.slip_stiffness"} <= {
        one.key for one in identified
    }
    for one in identified:
        assert one.value == pytest.approx(true[one.key], abs=3.0 * one.sigma), one.key
        if one.key.endswith(("mass", "drag_coefficient", "unloaded_radius", "slip_stiffness")):
            assert one.value == pytest.approx(true[one.key], rel=0.035), one.key
    left = {one.key for one in parameters if one.remedy}
    assert left <= {"front.push_out_pressure", "rear.push_out_pressure"}
    assert with_parameters(start, parameters).vehicle.mass == used["vehicle.mass"]
    assert found.zeros.accel_x[0] == pytest.approx(float(sensors[0]["bias"]), abs=3 * found.zeros.accel_x[1])


def test_the_drag_of_the_drive_is_the_torque_that_it_reports(car, found):
    table = overrun_table(found, new_params(start_of(SEED))[0])
    per_torque = 1.0 / (0.361 * float(car[2][0]["mass"]))
    assert len(table.rows) >= 3
    for row in table.rows:
        assert float(row[1]) == pytest.approx(float(row[3]) * per_torque, abs=0.03), row


def test_every_fit_is_drawn(found):
    panels = panels_of(found, new_params(start_of(SEED))[0])
    assert len(panels) == 4
    assert all(np.isfinite([*panel.x, *panel.y]).all() and panel.lines for panel in panels)


def test_a_free_radius_is_the_inverse_of_a_rolling_one():
    for load in (2000.0, 6000.0):
        radius = free_radius(0.33, load, 2.4e5)
        assert rolling_radius(load, radius, 2.4e5) == pytest.approx(0.33, abs=1e-9)


def test_a_configuration_a_page_and_a_picture_are_written(car, tmp_path, capsys):
    out = tmp_path / "car.toml"
    identify_vehicle([car[1]], SUV, None, True, out)
    assert load_config(out).vehicle.mass != load_config(SUV).vehicle.mass
    page = (tmp_path / "car.md").read_text("utf-8")
    assert all(
        word in page for word in ("## Identified", "## Not identified", "## Zeros of sensors", "vehicle.mass")
    )
    assert (tmp_path / "car.svg").read_text("utf-8").count("<rect") >= 4
    said = capsys.readouterr()
    assert "next: brake-ecu replay" in said.err.splitlines()[-1]
    assert "offset =" in said.out
    (checked,) = [line for line in said.out.splitlines() if "predicted from the others" in line]
    assert f"{checked}." in page
    assert f"# {checked}\n" in out.read_text("utf-8")
    printed = [line for line in said.out.splitlines() if " ± " in line]
    rough = [line.split(" = ")[0].rpartition(".")[2] for line in printed if ", rough" in line]
    marked = [line for line in out.read_text("utf-8").splitlines() if ", rough" in line]
    assert 0 < len(rough) == len(marked) < len(printed)
    assert all(any(line.startswith(f"{name} = ") for line in marked) for name in rough)


def reduced(car, tmp_path, *without: str, rows: slice = slice(None)):
    table = pq.read_table(car[1]).slice(rows.start or 0, rows.stop)
    names = (
        [name for name in table.column_names if not name.startswith(without)]
        if without
        else table.column_names
    )
    path = tmp_path / "less.parquet"
    pq.write_table(table.select(names), path)
    return path


def keys_of(path, closed=True):
    config = load_config(SUV)
    params = new_params(config)
    drives = identify(read_drives([path], params, None), params, closed)
    return {one.key: one for one in parameters_of(drives, config)}


def test_without_motor_torque_mass_is_not_identified_and_the_brakes_are_for_starts_mass(car, tmp_path):
    keys = keys_of(reduced(car, tmp_path, "motor_torque"))
    assert "motors" in keys["vehicle.mass"].remedy
    assert "coast-down" in keys["vehicle.drag_coefficient"].remedy
    assert not keys["front.mu_nominal"].remedy


def test_without_a_reference_only_the_ratio_of_the_radii_is_identified(car, tmp_path):
    keys = keys_of(reduced(car, tmp_path, "vehicle_speed"))
    assert "speed reference" in keys["front.unloaded_radius"].remedy
    assert not keys["rear.unloaded_radius"].remedy
    assert keys["vehicle.pitch_gradient"].remedy
    assert keys["vehicle.track"].sigma > 0.02 * keys["vehicle.track"].value  # for START's tyres


def test_without_pressures_nothing_is_said_of_the_brakes(car, tmp_path):
    keys = keys_of(reduced(car, tmp_path, "calliper_pressure"))
    assert keys["front.mu_nominal"].remedy
    assert keys["rear.mu_nominal"].remedy
    assert not keys["vehicle.mass"].remedy


def test_without_a_yaw_rate_the_track_is_not_identified(car, tmp_path):
    keys = keys_of(reduced(car, tmp_path, "yaw_rate"))
    assert "slalom" in keys["vehicle.track"].remedy
    assert keys["front.vertical_stiffness"].remedy


def test_what_is_far_from_start_is_not_identified(car, tmp_path):
    """A third of the mass, half the track: motors and curves show others, START is of another car."""
    config = load_config(SUV)
    vehicle = config.vehicle.model_copy(update={"mass": config.vehicle.mass / 3.0, "track": 0.8})
    start = config.model_copy(update={"vehicle": vehicle})
    params = new_params(start)
    found = identify(read_drives([car[1]], params, None), params, True)
    keys = {one.key: one for one in parameters_of(found, start)}
    for key in ("vehicle.mass", "vehicle.track"):
        assert "a better START, which" in keys[key].remedy, key
        assert keys[key].value == keys[key].start, key


@pytest.mark.parametrize(
    ("without", "rows", "line"),
    [
        ((), slice(3000, 1000), "moves for 10 s only"),
        ((), slice(0, 1100), "moves for 0 s only"),
        (("wheel_speed_rr",), slice(0, 20000), "wheel_speed_rr: is missing"),
        (("wheel_speed",), slice(0, 20000), "wheel_speed_rr: are missing"),
    ],
)
def test_a_drive_that_tells_nothing_is_one_line(car, tmp_path, without, rows, line):
    path = reduced(car, tmp_path, *without, rows=slice(rows.start, rows.stop))
    with pytest.raises(UserError, match=line):
        identify_vehicle([path], SUV, None, False, tmp_path / "car.toml")
    assert not (tmp_path / "car.toml").exists()


def test_a_wrong_unit_is_reported(car, tmp_path):
    table = pq.read_table(car[1])
    place = table.column_names.index("accel_x")
    wrong = table.set_column(place, "accel_x", [np.asarray(table["accel_x"].to_pandas()) / 9.81])
    pq.write_table(wrong, tmp_path / "wrong.parquet")
    with pytest.raises(UserError, match=r'accel_x: reads 0\.1.* unit = "g"'):
        identify_vehicle([tmp_path / "wrong.parquet"], SUV, None, False, tmp_path / "car.toml")


def test_arguments_are_checked(car, tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("mass = [")
    for config, drive, out, line in (
        (bad, car[1], tmp_path / "car.toml", "not valid TOML"),
        (SUV, tmp_path / "none.log", tmp_path / "car.toml", "no such file"),
        (SUV, car[1], tmp_path / "car.txt", "let the name end in .toml"),
        (SUV, car[1], SUV, "would overwrite"),
    ):
        with pytest.raises(UserError, match=line):
            identify_vehicle([drive], config, None, False, out)
