"""Service braking of a configured car: ECE R13-H, Annex 3, 2.1.1, by the balance of its forces."""

import re
from pathlib import Path

import pytest

from ecu import cli
from ecu.errors import UserError
from ecu.settings.annex3 import LEAST_DECEL, full_braking
from ecu.settings.config import load_config, new_params, torque_per_bar

CONFIGS = Path(__file__).parents[3] / "config"
SUV = (CONFIGS / "suv.toml").read_text(encoding="utf-8")
PEDAL = "[0, 0, 0.8, 2.1, 4.0, 6.0, {}]"
NORM = "ECE R13-H Annex 3, 2.1.1 asks for 6.43 m/s^2"


def written(to: Path, **values: str) -> Path:
    """The SUV with keys of every section that has them set anew; `max_pressure` is put into [control]."""
    text = SUV.replace("[control]", "[control]\nmax_pressure = 180.0")
    for key, value in values.items():
        text, count = re.subn(rf"(?m)^{key} *= *[^#\n]*", f"{key} = {value} ", text)
        assert count
    path = to / "car.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_car_brakes_as_hard_as_its_whole_pedal_asks(path: Path) -> None:
    config = load_config(path)
    for load in config.vehicle.loads():
        reached = full_braking(new_params(config)[0], load)
        assert reached == pytest.approx(config.control.pedal_decel[-1]) == 10.0
        assert reached > LEAST_DECEL


@pytest.mark.parametrize("pressure", [85.0, 90.0])
def test_both_axles_at_the_greatest_pressure_by_hand(tmp_path: Path, pressure: float) -> None:
    """Laden, 10 m/s^2 needs 119 bar in front and 105 bar in the rear; less is all that there is."""
    config = load_config(written(tmp_path, max_pressure=f"{pressure}"))
    p = new_params(config)[0]
    per_bar, radius = torque_per_bar(p), p["wheel_radius"]
    force = sum(2.0 * per_bar[i] * (pressure - 0.5) / radius[i] for i in (0, 2))
    assert full_braking(p, config.vehicle.loads()[-1]) == pytest.approx(force / 2600.0)


def test_an_axle_gives_no_more_than_its_share(tmp_path: Path) -> None:
    """A rear axle with brakes to spare is not asked for more: 10 m/s^2, 76.8 % of it in front."""
    config = load_config(written(tmp_path, max_pressure="110.0"))
    p = new_params(config)[0]
    rear = (1.0 - (1.385 + 10.0 / 9.81 * 0.65) / 2.665) * 10.0
    front = 2.0 * torque_per_bar(p)[0] * 109.5 / p["wheel_radius"][0] / 2600.0
    assert full_braking(p, config.vehicle.loads()[-1]) == pytest.approx(front + rear)


WEAK = [
    # what is changed, key, what is said
    ({"pedal_decel": PEDAL.format(6.4)}, "control.pedal_decel", f"ends at 6.4 m/s^2; {NORM}"),
    ({"max_pressure": "21.0"}, "control.max_pressure", f"by 1.79 m/s^2; {NORM}: give 75 bar or more"),
    ({"max_pressure": "74.0"}, "control.max_pressure", "give 75 bar or more"),
    ({"mu_nominal": "0.184"}, "front.piston_diameter", f"by 6.4 m/s^2; {NORM}: this axle gives"),
    (
        {"piston_diameter": "0.034"},
        "front.piston_diameter",
        "correct its pistons, effective_radius or mu_nom",
    ),
]


@pytest.mark.parametrize(("values", "key", "said"), WEAK, ids=[str(row[0]) for row in WEAK])
def test_a_car_that_brakes_too_little_is_one_line(tmp_path: Path, values, key: str, said: str) -> None:
    path = written(tmp_path, **values)
    with pytest.raises(UserError) as caught:
        load_config(path)
    assert str(caught.value).startswith(f"{path}: {key}: ")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "values", [{"pedal_decel": PEDAL.format(6.43)}, {"max_pressure": "75.0"}, {"mu_nominal": "0.185"}]
)
def test_what_is_just_enough_is_enough(tmp_path: Path, values) -> None:
    load_config(written(tmp_path, **values))


def test_the_check_names_it_beside_the_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, max_pressure="60.0")
    assert cli.main(["config", "check", str(path)]) == 2
    printed = capsys.readouterr()
    assert "10.00 m/s^2, the linings alone brake by 5.19 m/s^2 (6.43 in 2.1.1)" in printed.out
    assert printed.err.startswith(
        f"brake-ecu: {path}: control.max_pressure: the linings brake the car, laden, by"
    )
