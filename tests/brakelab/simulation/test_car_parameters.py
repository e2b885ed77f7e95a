"""`[car]` sets what it names, in its unit or as a share of the drawn car, and nothing else."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.records import PARAMS
from brakelab.simulation.car_parameters import PARAMETERS
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.vehicle_bus import new_vehicle
from ecu.errors import UserError

STOP = {"plant": "suv", "initial_speed": 8.0, "phase": [{"kind": "brake", "decel": 4.0, "until_speed": 0.0}]}
DRAWN = new_vehicle(Scenario.model_validate(STOP), 3).params[0]
ALL = np.ones(4)


@pytest.mark.parametrize(
    ("name", "value", "field", "expected"),
    [
        ("mass", 1800.0, "mass", 1800.0),
        ("mass", "110 %", "mass", 1.1 * DRAWN["mass"]),
        ("push_out_pressure", 0.7, "push_out_pressure", 0.7e5 * ALL),
        ("friction_scale", "80%", "friction_scale", 0.8 * DRAWN["friction_scale"]),
        ("friction_scale_front", "50.5 %", "friction_scale", [0.505, 0.505, 1, 1] * DRAWN["friction_scale"]),
        ("free_radius_rl", 0.35, "free_radius", [*DRAWN["free_radius"][:2], 0.35, DRAWN["free_radius"][3]]),
    ],
)
def test_one_parameter_is_set(name: str, value: float | str, field: str, expected: object) -> None:
    car = new_vehicle(Scenario.model_validate(STOP | {"car": {name: value}}), 3).params[0]
    np.testing.assert_allclose(car[field], expected, rtol=1e-12)
    assert [one for one in PARAMS.names or () if not np.array_equal(car[one], DRAWN[one])] == [field]


@pytest.mark.parametrize("names", [("", "_front", "_fl"), ("_fl", "_front", ""), ("_front", "", "_fl")])
def test_fewer_wheels_go_before_more_and_shares_are_of_the_drawn_car(names: tuple[str, ...]) -> None:
    values = {"": "80 %", "_front": "90 %", "_fl": 1.1}
    given = {f"friction_scale{name}": values[name] for name in names}
    car = new_vehicle(Scenario.model_validate(STOP | {"car": given}), 3).params[0]
    drawn = DRAWN["friction_scale"]
    np.testing.assert_allclose(car["friction_scale"], [1.1, 0.9 * drawn[1], *0.8 * drawn[2:]], rtol=1e-12)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("mas = 1.0", "car: mas: no parameter of a car; did you mean mass"),
        ("mass_fl = 1.0", "car: mass_fl: no parameter of a car"),
        ("mass = 0.0", "car: mass: give a finite value above 0"),
        ('mass = "0 %"', "car: mass: give a finite value above 0"),
        ("mass = nan", "car: mass: give a finite value above 0 (found nan)"),
        ("mass = inf", "car: mass: give a finite value above 0 (found inf)"),
        ("mass = true", "car: mass: give a number, or a share"),
        ("mass = [1.0]", "car: mass: give a number, or a share"),
        ('mass = "80"', 'car: mass: give a number, or a share of the drawn one, "80 %"'),
    ],
)
def test_a_mistake_is_one_line(tmp_path: Path, line: str, message: str) -> None:
    phase = '[[phase]]\nkind = "coast"\nseconds = 1.0\n'
    (tmp_path / "s.toml").write_text(f'plant = "suv"\ninitial_speed = 8.0\n{phase}[car]\n{line}\n')
    with pytest.raises(UserError) as caught:
        load_scenario(tmp_path / "s.toml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("car", [{"mass": 1.9}, {"mass": 1.9e6}, {"free_radius_fl": 350.0}])
def test_another_unit_than_the_car_s_is_refused(car: dict[str, float | str]) -> None:
    ((name, value),) = car.items()
    with pytest.raises(UserError, match=rf"^\[car\]: {name} = {value}: the drawn car has \d"):
        new_vehicle(Scenario.model_validate(STOP | {"car": car}), 3)


def test_all_are_parameters_of_the_car_and_documented() -> None:
    page = (Path(__file__).parents[3] / "docs/rig.md").read_text("utf-8")
    for name, (unit, _) in PARAMETERS.items():
        assert PARAMS[name].shape in ((), (4,))
        assert f"`{name}` {unit}" in page
