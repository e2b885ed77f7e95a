"""Plant files: the shipped cars, drawn cars, one line for every mistake."""

from collections.abc import Callable
from pathlib import Path

import pytest

from brakelab.plant.description import Plant, PlantFileError, load_plant, nominal

CONFIG = Path(__file__).parents[3] / "config" / "plant"
ENGINE = "drag_torque = 30.0\nlowest_speed = 130.0\nratios = [6.0, 3.0]\nshare_front = 1.0\n"


@pytest.mark.parametrize(
    ("name", "mass", "base", "friction"),
    [
        ("suv", 2105, 2.665, (0.3825, 0.495)),
        ("suv14", 2105, 2.665, (0.3825, 0.495)),
        ("sedan", 2100, 3.07, (0.43, 0.39)),
        ("lcv", 1900, 3.0, (0.42, 0.41)),
    ],
)
def test_shipped_cars_are_those_of_appendix_d(
    name: str, mass: float, base: float, friction: tuple[float, float]
) -> None:
    plant = load_plant(CONFIG / f"{name}.toml")
    body = plant.vehicle.body
    assert body.mass == mass
    assert body.front_length + body.rear_length == pytest.approx(base)
    levels = [plant.brake(i).friction_level * plant.brake(i).friction_nominal for i in (0, 3)]
    assert levels == pytest.approx(friction)
    assert nominal(plant)["mass"] == mass


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda text: text.replace("mass = 2105.0", "mass = -1.0"), "body.mass"),
        (lambda text: text.replace("track = 1.625", ""), "body.track"),
        (lambda text: text.replace("[motor]", "[motor]\ncolour = 3"), "motor.colour"),
        (lambda text: text.replace('lining = "A"', 'lining = "Z"'), "brake_front.lining"),
        (lambda text: text.replace('lining = "A"', 'lining = "A"\nfriction = "Z"'), "brake_front.friction"),
        (lambda text: f"{text}\n[engine]\n{ENGINE}".replace("[6.0, 3.0]", "[3.0, 6.0]"), "engine"),
        (lambda text: f"{text}\n[engine]\n{ENGINE}".replace("[6.0, 3.0]", "[]"), "engine.ratios"),
        (lambda text: text.replace("[body]", "[body"), "not valid TOML"),
    ],
)
def test_a_mistake_in_a_plant_file_is_one_line(
    tmp_path: Path, edit: Callable[[str], str], place: str
) -> None:
    path = tmp_path / "car.toml"
    path.write_text(edit((CONFIG / "suv.toml").read_text()))
    (tmp_path / "linings.toml").write_text((CONFIG / "linings.toml").read_text())
    with pytest.raises(PlantFileError) as caught:
        load_plant(path)
    assert caught.value.place == place
    assert "\n" not in caught.value.remedy


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(PlantFileError, match=r"nowhere\.toml"):
        load_plant(tmp_path / "nowhere.toml")


def test_a_suspension_makes_the_difference_between_the_two_sport_utility_vehicles(suv: Plant) -> None:
    full = load_plant(CONFIG / "suv14.toml")
    assert nominal(full)["suspended"] == 1
    assert nominal(suv)["suspended"] == 0
    for section in ("body", "tyre", "brake_front", "brake_rear", "hydraulics", "sensor"):
        assert getattr(full.vehicle, section) == getattr(suv.vehicle, section)


@pytest.mark.parametrize(
    ("edit", "place", "remedy"),
    [
        (
            lambda text: text.replace("[tyre]", "[attitude]\nfrequency = 1\n[tyre]"),
            "attitude.damping",
            "required",
        ),
        (lambda text: text.replace("[suspension]", "[spring]"), "spring", "not permitted"),
        (lambda text: text.replace("-0.3, -0.1, 0.0", "-0.3, -0.4, 0.0"), "suspension", "rising speeds"),
        (lambda text: text.replace("0.0, 300.0", "0.0, -300.0"), "suspension", "sign"),
        (lambda text: text.replace("magic_c", "burckhardt_fall = 0.4\nmagic_c"), "tyre", "either"),
        (lambda text: text.replace("magic_e = 0.2", ""), "tyre", "either"),
        (lambda text: text.replace("peak_power", "# "), "motor", "or neither"),
        (lambda text: text.replace("peak_torque = 2", "peak_torque = 1"), "motor", "not below"),
        (lambda text: text[: text.index("[suspension]")] + text[text.index("[tyre]") :], "", "either"),
    ],
)
def test_a_mistake_in_a_chassis_is_one_line(
    tmp_path: Path, edit: Callable[[str], str], place: str, remedy: str
) -> None:
    path = tmp_path / "car.toml"
    path.write_text(edit((CONFIG / "suv14.toml").read_text()))
    (tmp_path / "linings.toml").write_text((CONFIG / "linings.toml").read_text())
    with pytest.raises(PlantFileError) as caught:
        load_plant(path)
    assert caught.value.place == place
    assert remedy in caught.value.remedy
    assert "\n" not in caught.value.remedy


def test_a_file_may_choose_burckhardts_tyre(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    text = (CONFIG / "suv14.toml").read_text()
    path.write_text(text.replace("magic_c = 1.6", "burckhardt_fall = 0.406").replace("magic_e = 0.2", ""))
    (tmp_path / "linings.toml").write_text((CONFIG / "linings.toml").read_text())
    assert nominal(load_plant(path))["burckhardt_fall"] == 0.406


def test_an_engine_that_the_file_describes(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f"{(CONFIG / 'suv.toml').read_text()}\n[engine]\n{ENGINE}")
    (tmp_path / "linings.toml").write_text((CONFIG / "linings.toml").read_text())
    car = nominal(load_plant(path))[0]
    assert car["engine_ratio"].tolist() == [6.0, 3.0, *[0.0] * 8]
    assert car["engine_share"].tolist() == [0.5, 0.5, 0.0, 0.0]
    assert (car["engine_drag_torque"], car["engine_lowest_speed"]) == (30.0, 130.0)


def test_a_hydraulic_unit_that_the_file_describes(tmp_path: Path) -> None:
    unit = "[hydraulics]\nbuild_up = [0.003, 0.074, 0.15]\nrise_limit = 80.0"
    path = tmp_path / "car.toml"
    path.write_text((CONFIG / "suv.toml").read_text().replace("[hydraulics]", unit))
    (tmp_path / "linings.toml").write_text((CONFIG / "linings.toml").read_text())
    car, usual = nominal(load_plant(path))[0], nominal(load_plant(CONFIG / "suv.toml"))[0]
    assert car["build_up"].tolist() == [0.003, 0.074, 0.15]
    assert car["release"].tolist() == usual["release"].tolist()
    assert (car["rise_limit"], car["fall_limit"], usual["rise_limit"]) == (80e5, float("inf"), float("inf"))
