"""`config check`: all mistakes of a file at once, and a car's figures by balances of force and moment."""

import math
import re
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from ecu import cli
from ecu.algorithm.control.distribution import front_share
from ecu.algorithm.estimation.joint.whole_filter import CEILING, FALL, GRIP
from ecu.algorithm.step import new_state
from ecu.recording.store import open_store, save
from ecu.settings.check import axle_torque_per_bar, figures, grip, held_demand, pressures
from ecu.settings.config import load_config, new_params, store_key

CONFIGS = Path(__file__).parents[3] / "config"
SUV = (CONFIGS / "suv.toml").read_text(encoding="utf-8")
CARS = sorted(CONFIGS.glob("*.toml"))


def changed(to: Path, **values: str) -> Path:
    text = SUV
    for key, value in values.items():
        text, count = re.subn(rf"(?m)^{key} *= *[^#\n]*", value, text)
        assert count
    out = to / "car.toml"
    out.write_text(text, encoding="utf-8")
    return out


def test_all_mistakes_are_reported_at_once_unknown_keys_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = changed(
        tmp_path,
        mass="mas = 1620.0 ",
        piston_diameter="piston_diameter = 60.0 ",
        mu_nominal='mu_nominal = "good" ',
    )
    assert cli.main(["config", "check", str(path)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"brake-ecu: {path}: {line}"
        for line in (
            "vehicle.mas: unknown key; did you mean mass?",
            "vehicle.mass: missing; add this key",
            "front.piston_diameter: give a value below 0.15 m (found 60.0)",
            "front.mu_nominal: give a number (found 'good')",
            "rear.piston_diameter: give a value below 0.15 m (found 60.0)",
            "rear.mu_nominal: give a number (found 'good')",
        )
    ]


def test_other_commands_tell_the_first_and_how_many_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = changed(tmp_path, mass="mas = 1620.0 ")
    assert cli.main(["simulate", "stop-1", "--config", str(path), "--out", str(tmp_path / "x")]) == 2
    assert "vehicle.mas: unknown key; did you mean mass? (1 more)" in capsys.readouterr().err


@pytest.mark.parametrize("path", CARS, ids=lambda path: path.stem)
def test_a_shipped_car_is_described_in_figures(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["config", "check", str(path)]) == 0
    out = capsys.readouterr().out
    assert out.endswith("nothing wrong\n")
    assert "Annex 5       laden" in out
    assert "-0.000" not in out


@pytest.mark.parametrize("path", CARS, ids=lambda path: path.stem)
@pytest.mark.parametrize("z", [0.3, 0.7])
def test_pressures_brake_the_car_at_the_rate_and_use_both_axles_alike(path: Path, z: float) -> None:
    """By the clamping force of the pistons on both pads, and moments about the contact of the rear tyres."""
    config = load_config(path)
    car, axles = config.vehicle, (config.front, config.rear)
    params = new_params(config)[0]
    forces = []
    for axle, pressure, radius in zip(axles, pressures(params, z), params["wheel_radius"][::2], strict=True):
        clamp = (pressure - axle.push_out_pressure) * 1e5 * axle.pistons * np.pi / 4 * axle.piston_diameter**2
        forces.append(2.0 * 2.0 * axle.mu_nominal * clamp * axle.effective_radius / radius)
    assert sum(forces) == pytest.approx(z * 9.81 * car.mass)
    behind = car.wheelbase - car.front_axle
    on_front = car.mass * 9.81 * (behind + z * car.cog_height) / car.wheelbase
    assert forces[0] / on_front == pytest.approx(forces[1] / (car.mass * 9.81 - on_front))


@pytest.mark.parametrize("path", CARS, ids=lambda path: path.stem)
@pytest.mark.parametrize("laden", [False, True])
@pytest.mark.parametrize("road", [0.2, 0.6])
def test_a_road_holds_the_demand_at_which_the_first_axle_uses_all_of_it(
    path: Path, laden: bool, road: float
) -> None:
    """By the forces of both axles and moments about the contact of the rear tyres; z of the loaded car."""
    config = load_config(path)
    params, load = new_params(config)[0], config.vehicle.loads()[-1 if laden else 0]
    demand = held_demand(params, load, road)
    force = demand * config.vehicle.mass
    front = force * front_share(params, demand)
    behind, rate = config.vehicle.wheelbase - load.front_axle, force / (load.mass * 9.81)
    on_front = load.mass * 9.81 * (behind + rate * load.cog_height) / config.vehicle.wheelbase
    used = front / on_front, (force - front) / (load.mass * 9.81 - on_front)
    assert max(used) == pytest.approx(road, rel=1e-3)
    held = [
        float(one)
        for one in re.findall(r"demand of (.*) m/s\^2, .* pedal;", grip(params, load))[0].split(",")
    ]
    assert held[0 if road == 0.2 else 2] == pytest.approx(demand, abs=0.06)


def test_the_whole_pedal_is_reported_with_the_adhesion_that_it_needs() -> None:
    """10 m/s^2 at the ideal distribution: both axles use 10 / 9.81."""
    config = load_config(CONFIGS / "suv.toml")
    said = grip(new_params(config)[0], config.vehicle.loads()[0])
    assert said.endswith("all of it, 10.0 m/s^2, needs 1.02")
    assert "unladen: roads of 0.2, 0.4, 0.6, 0.8 hold a demand of 2.0, 3.9, 5.9, 7.8 m/s^2" in said


@pytest.mark.parametrize(
    ("case", "variance", "said"),
    [
        ("learned", 0.01, "learned: the linings brake by at most 7.0 +- 0.7 m/s^2, 82 % of the pedal;"),
        ("of another car: none", 0.0, "no ceiling learned"),
    ],
)
def test_a_learned_ceiling_is_compared_with_the_pedal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str, variance: float, said: str
) -> None:
    """suv: 80 % of the pedal asks for 6.6 m/s^2, 100 % for 10."""
    config = load_config(CONFIGS / "suv.toml")
    learned = new_state(new_params(config))["learned"].copy()
    learned["whole"][0, GRIP], learned["whole"][0, FALL] = math.log(10.0 / CEILING), 0.3
    learned["whole_covariance"][0] = np.diag([0.01, variance, 0.01, 0.1, 1.0, 0.04])[np.tril_indices(6)]
    with closing(open_store(tmp_path)) as store:
        save(store, store_key(config), learned)
    assert cli.main(["config", "check", str(CONFIGS / "suv.toml"), "--state", str(tmp_path)]) == 0
    assert f"grip          {said}" in capsys.readouterr().out


def test_pistons_counted_on_both_sides_show_as_twice_the_torque(tmp_path: Path) -> None:
    right = new_params(load_config(CONFIGS / "suv.toml"))[0]
    config = load_config(changed(tmp_path, pistons="pistons = 2 "))
    wrong = new_params(config)[0]
    assert axle_torque_per_bar(wrong) == pytest.approx([2.0 * one for one in axle_torque_per_bar(right)])
    assert f"front {axle_torque_per_bar(wrong)[0]:.1f}," in figures(config, wrong)[1]


def test_a_distribution_that_is_forbidden_is_shown_with_its_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SUV.replace("[control]", '[control]\ndistribution = "fixed"\nfront_share = 0.6')
    path = tmp_path / "car.toml"
    path.write_text(text, encoding="utf-8")
    assert cli.main(["config", "check", str(path)]) == 2
    said = capsys.readouterr()
    assert "3.1 A" in said.err
    assert "front share 60.0 %" in said.out
