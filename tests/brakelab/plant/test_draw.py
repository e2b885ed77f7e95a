"""Drawn cars: how far they spread, what stays, and that a seed is a car."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.description import Plant, PlantFileError, nominal
from brakelab.plant.draw import Widths, draw, draw_sensors, load_widths
from brakelab.plant.sensor_errors import STANDARD

DRAW = Path(__file__).parents[3] / "config" / "plant" / "draw.toml"
SEEDS = range(80)
WIDE, NOMINAL = load_widths(DRAW, "wide"), load_widths(DRAW, "nominal")

Column = Callable[[NDArray[np.void]], NDArray[np.float64]]


def field(name: str, *place: int) -> Column:
    return lambda cars: np.asarray(cars[name][(slice(None), *place)])


def rear_over_front(cars: NDArray[np.void]) -> NDArray[np.float64]:
    return np.asarray(cars["slip_stiffness"][:, 2] / cars["slip_stiffness"][:, 0])


def drawn(plant: Plant, width: Widths, column: Column) -> NDArray[np.float64]:
    """Return a quantity of every drawn car over that of the car as described."""
    cars = np.concatenate([draw(plant, seed, width) for seed in SEEDS])
    return column(cars) / column(nominal(plant))


BOTH = [
    ("mass", field("mass"), 0.03),
    ("height of the centre of gravity", field("cog_height"), 0.05),
    ("free radius", field("free_radius", 2), 0.003),
    ("wheel inertia", field("wheel_inertia", 0), 0.1),
    ("push-out pressure", field("push_out_pressure", 0), 0.3 / 0.5),
]
WIDER = [
    ("place of the centre of gravity", field("front_length"), 0.04 / 1.29),
    ("drag", field("drag_factor"), 0.15),
    ("rolling resistance", field("rolling_resistance"), 0.15),
    ("pitch", field("pitch_gradient"), 0.2),
    ("vertical stiffness", field("vertical_stiffness", 0), 0.15),
    ("stiffness rear over front", rear_over_front, 0.0726),
    ("effective radius", field("effective_radius", 0), 0.02),
    ("piston area", field("piston_area", 1), 0.01),
    ("disc's heating", field("heating", 0), 0.15),
    ("disc's cooling", field("cooling_by_speed", 2), 0.3),
    ("inertia of the hydraulics", field("build_up", 0), 0.5),
    ("damping of the hydraulics", field("release", 1), 0.5),
    ("dead time of the hydraulics", field("release", 2), 0.3),
]  # fmt: skip


@pytest.mark.parametrize(
    ("width", "column", "spread"),
    [pytest.param(width, row[1], row[2], id=f"{name}: {row[0]}")
     for name, width, rows in (("wide", WIDE, BOTH + WIDER), ("nominal", NOMINAL, BOTH)) for row in rows],
)  # fmt: skip
def test_drawn_cars_spread_as_far_as_they_should(
    suv: Plant, width: Widths, column: Column, spread: float
) -> None:
    away = drawn(suv, width, column) - 1.0
    assert np.all(np.abs(away) <= 1.02 * spread)
    assert np.ptp(away) > 1.6 * spread


def test_friction_is_any_the_data_sheet_cannot_rule_out(suv: Plant) -> None:
    """Level 0.7 to 1.3 of the data sheet per axle, and 4 % per wheel, whatever the law."""
    reference = 0.45
    levels, sides, laws = [], [], set()
    for seed in SEEDS:
        car = draw(suv, seed, WIDE)[0]
        one = draw(suv, seed, WIDE.model_copy(update={"friction_wheel": 0.0, "friction_axle": (1.0, 1.0)}))[0]
        share = car["friction_scale"] / one["friction_scale"]
        levels += [share[:2].mean(), share[2:].mean()]
        sides.append(share[0] / share[1])
        laws.add(tuple(car["friction_law"]))
    print(min(levels), max(levels), np.std(sides), laws, reference)
    assert 0.67 < min(levels) < 0.75
    assert 1.25 < max(levels) < 1.34
    assert 0.02 < np.std(sides) < 0.05
    assert len(laws) == 3
    assert all(len(set(law)) == 1 for law in laws)


def test_linings_of_one_law_still_differ(suv: Plant) -> None:
    only = WIDE.model_copy(update={"friction_laws": ("surface",)})
    rows = [draw(suv, seed, only)[0]["friction_row"][0] for seed in range(10)]
    assert len({row.tobytes() for row in rows}) == 10


def test_what_the_kind_draw_leaves_alone(suv: Plant) -> None:
    car, base = draw(suv, 5, NOMINAL)[0], nominal(suv)[0]
    for name in ("friction_scale", "track", "vertical_stiffness", "nominal_load", "friction_row", "build_up"):
        assert np.array_equal(car[name], base[name])
    assert draw_sensors(STANDARD, 5, NOMINAL)["accel_x"].noise == STANDARD["accel_x"].noise


@pytest.mark.parametrize("width", [WIDE, NOMINAL], ids=["wide", "nominal"])
def test_same_seed_same_car(suv: Plant, width: Widths) -> None:
    assert draw(suv, 11, width).tobytes() == draw(suv, 11, width).tobytes() != draw(suv, 12, width).tobytes()
    assert draw_sensors(STANDARD, 3, width) == draw_sensors(STANDARD, 3, width)


def test_sensors_spread() -> None:
    cars = [draw_sensors(STANDARD, seed, WIDE) for seed in SEEDS]
    noise = np.array([car["calliper_pressure"].noise / 1.8 for car in cars])
    motors = np.array([(car["motor_torque"].noise, car["motor_torque"].scale) for car in cars])
    assert 0.5 <= noise.min() < 0.6
    assert 1.7 < noise.max() <= 2.0
    assert 3.0 <= motors[:, 0].min() < 4.0
    assert 9.0 < motors[:, 0].max() <= 10.0
    assert np.ptp(motors[:, 1]) > 0.05
    assert cars[0]["accel_x"].bias == (-0.1, 0.1)
    assert cars[0]["calliper_pressure"].bias == (-0.7, 0.7)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("mass = 0.03", "mass = -0.1", "wide.mass"),
        ("[0.7, 1.3]", "[1.3, 0.7]", "wide.friction_axle"),
        ("[nominal]", "[kind]", "nominal"),
    ],
)
def test_a_mistake_in_the_file_is_one_line(tmp_path: Path, old: str, new: str, place: str) -> None:
    path = tmp_path / "draw.toml"
    path.write_text(DRAW.read_text().replace(old, new, 1))
    with pytest.raises(PlantFileError) as caught:
        load_widths(path, "wide")
    assert caught.value.place == place


def test_an_unknown_law_is_one_line(suv: Plant) -> None:
    with pytest.raises(PlantFileError, match="'Stribeck' is no law of lining A"):
        draw(suv, 0, WIDE.model_copy(update={"friction_laws": ("Stribeck",)}))
