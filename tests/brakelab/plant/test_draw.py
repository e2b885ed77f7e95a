"""Drawn cars: each width of the file is its quantity's spread, what stays, and that a seed is a car."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.description import Engine, Plant, PlantFileError, load_plant, nominal
from brakelab.plant.draw import Widths, draw, draw_sensors, load_widths
from brakelab.plant.sensor_errors import STANDARD

pytestmark = pytest.mark.study

DRAW = Path(__file__).parents[3] / "config" / "plant" / "draw.toml"
SEEDS, MANY = range(80), range(150)
WIDE, NOMINAL = load_widths(DRAW, "wide"), load_widths(DRAW, "nominal")

Quantity = Callable[[NDArray[np.void], Any], NDArray[np.float64]]


def relative(name: str, *place: int | list[int]) -> Quantity:
    """Return what makes of cars and the car as described how far they are off, a column for each draw."""

    def off(cars: NDArray[np.void], base: Any) -> NDArray[np.float64]:
        away = cars[name] / base[name] - 1.0
        return np.asarray(away[(slice(None), *place)]).reshape(len(cars), -1)

    return off


def moved(cars: NDArray[np.void], base: Any) -> NDArray[np.float64]:
    """The wheelbase stays."""
    front = cars["front_length"] - base["front_length"]
    np.testing.assert_allclose(front, base["rear_length"] - cars["rear_length"], atol=1e-12)
    return np.asarray(front).reshape(-1, 1)


def pushed(cars: NDArray[np.void], base: Any) -> NDArray[np.float64]:
    return np.asarray((cars["push_out_pressure"] - base["push_out_pressure"])[:, AXLES] / 1e5)


def factor(name: str) -> Quantity:
    return lambda cars, base: (cars[name] / base[name]).reshape(len(cars), -1)[:, :1]


def of_data_sheet(cars: NDArray[np.void], base: Any) -> NDArray[np.float64]:
    """The car's file gives 0.85 of it in front and 1.10 at the rear."""
    return np.asarray(cars["friction_scale"] / base["friction_scale"] * [0.85, 0.85, 1.10, 1.10])[:, AXLES]


def relative_level(name: str) -> Quantity:
    return lambda cars, base: np.asarray(cars[name][:, AXLES] / base[name][AXLES])


AXLES = [0, 2]
EVERY = [0, 1, 2, 3]
# Key of draw.toml, what it changes of a car's parameters, the quantity it is the width of, a column for each
# draw of its own: per car, per axle or per wheel.
WIDTHS: list[tuple[str, set[str], Quantity]] = [
    ("mass", {"mass"}, relative("mass")),
    ("cog_height", {"cog_height"}, relative("cog_height")),
    ("cog_place", {"front_length", "rear_length"}, moved),
    ("drag", {"drag_factor"}, relative("drag_factor")),
    ("rolling_resistance", {"rolling_resistance"}, relative("rolling_resistance")),
    ("pitch_gradient", {"pitch_gradient"}, relative("pitch_gradient")),
    ("free_radius", {"free_radius"}, relative("free_radius", EVERY)),
    ("vertical_stiffness", {"vertical_stiffness"}, relative("vertical_stiffness", 0)),
    ("wheel_inertia", {"wheel_inertia"}, relative("wheel_inertia", 0)),
    ("slip_stiffness", {"slip_stiffness"}, relative("slip_stiffness", 0)),
    ("slip_stiffness_axle", {"slip_stiffness"}, relative("slip_stiffness", AXLES)),
    ("stiffness_degression", {"stiffness_degression"}, factor("stiffness_degression")),
    ("friction_axle", {"friction_scale"}, of_data_sheet),
    ("friction_wheel", {"friction_scale"}, relative("friction_scale", EVERY)),
    ("effective_radius", {"effective_radius"}, relative("effective_radius", AXLES)),
    ("piston_area", {"piston_area"}, relative("piston_area", EVERY)),
    ("push_out_pressure", {"push_out_pressure"}, pushed),
    ("disc_heating", {"heating"}, relative("heating", AXLES)),
    ("disc_cooling", {"cooling", "cooling_by_speed"}, relative("cooling_by_speed", AXLES)),
    ("wear_lot", {"wear_scale"}, relative_level("wear_scale")),
    ("emission_lot", {"emission_scale"}, relative_level("emission_scale")),
    ("hydraulic_inertia", {"build_up", "release"}, relative("build_up", 0)),
    ("hydraulic_damping", {"build_up", "release"}, relative("release", 1)),
    ("hydraulic_dead_time", {"build_up", "release"}, relative("release", 2)),
    ("engine_drag", {"engine_drag_torque", "engine_drag_growth"}, relative("engine_drag_growth")),
]
SENSORS = {
    "motor_torque_scale",
    "motor_torque_noise",
    "sensor_noise",
    "accel_zero",
    "yaw_rate_zero",
    "steering_zero",
    "pressure_zero",
}


@pytest.fixture(scope="module")
def suv() -> Plant:
    """Return the car as described, with an engine."""
    plant = load_plant(DRAW.with_name("suv.toml"))
    engine = Engine(
        drag_torque=25.0, drag_growth=0.06, lowest_speed=126.0, ratios=(6.0, 3.0), share_front=1.0
    )
    return plant.model_copy(update={"vehicle": plant.vehicle.model_copy(update={"engine": engine})})


def cars_of(plant: Plant, width: Widths, seeds: range = MANY) -> NDArray[np.void]:
    return np.concatenate([draw(plant, seed, width) for seed in seeds])


def changed(cars: NDArray[np.void], base: Any) -> set[str]:
    """Return the parameters in which any car differs from the one described."""
    names = cars.dtype.names or ()
    return {
        name
        for name in names
        if not np.array_equal(cars[name], np.broadcast_to(base[name], cars[name].shape))
    }


def check_even(drawn: NDArray[np.float64], width: float | tuple[float, float]) -> None:
    """Check an even distribution over the width, each column drawn for itself."""
    low, high = width if isinstance(width, tuple) else (-width, width)
    even = (drawn - 0.5 * (low + high)) / (0.5 * (high - low))
    print(np.abs(even).max(axis=0), even.mean(axis=0), even.std(axis=0))
    assert np.all(np.abs(even) <= 1.0 + 1e-9)
    # Four standard errors of mean and standard deviation of so many.
    assert np.all(np.abs(even.mean(axis=0)) < 4.0 / np.sqrt(3.0 * len(even)))
    assert even.std(axis=0) * np.sqrt(3.0) == pytest.approx(
        np.ones(even.shape[1]), abs=4.0 * np.sqrt(0.2 / len(even))
    )
    together = np.corrcoef(even.T).reshape(even.shape[1], -1) - np.eye(even.shape[1])
    assert np.all(np.abs(together) < 4.0 / np.sqrt(len(even)))


def test_every_width_of_the_file_is_looked_at() -> None:
    assert {row[0] for row in WIDTHS} | SENSORS | {"friction_laws", *DAYS} == set(Widths.model_fields)


DAYS = {"wear_climate": "wear_scale", "emission_day": "emission_scale"}


@pytest.mark.parametrize(("key", "changes"), DAYS.items(), ids=DAYS)
def test_days_differ_by_the_logarithm_of_their_climate(suv: Plant, key: str, changes: str) -> None:
    days = np.log(cars_of(suv, Widths(**{key: 0.1}))[changes])
    assert np.all(np.ptp(days, axis=1) < 1e-12)  # the same for all pads
    assert days[:, 0].mean() == pytest.approx(0.0, abs=4 * 0.1 / np.sqrt(len(days)))
    assert days[:, 0].std() == pytest.approx(0.1, rel=4 / np.sqrt(2 * len(days)))


@pytest.fixture(scope="module")
def wide_cars(suv: Plant) -> NDArray[np.void]:
    return cars_of(suv, WIDE)


# Two keys are widths of one parameter: each is looked at alone.
SHARED = {
    "slip_stiffness",
    "slip_stiffness_axle",
    "friction_axle",
    "friction_wheel",
    "wear_lot",
    "emission_lot",
}


def alone(key: str) -> Widths:
    return Widths(**{key: getattr(WIDE, key)})


@pytest.mark.parametrize(("key", "fields"), [row[:2] for row in WIDTHS], ids=[row[0] for row in WIDTHS])
def test_a_width_changes_its_own_quantity_alone(suv: Plant, key: str, fields: set[str]) -> None:
    assert changed(cars_of(suv, alone(key), range(5)), nominal(suv)[0]) == fields


@pytest.mark.parametrize(("key", "quantity"), [row[::2] for row in WIDTHS], ids=[row[0] for row in WIDTHS])
def test_a_quantity_spreads_as_far_as_the_file_says(
    suv: Plant, wide_cars: NDArray[np.void], key: str, quantity: Quantity
) -> None:
    cars = cars_of(suv, alone(key)) if key in SHARED else wide_cars
    check_even(quantity(cars, nominal(suv)[0]), getattr(WIDE, key))


def test_what_one_key_draws_goes_with_no_other(suv: Plant, wide_cars: NDArray[np.void]) -> None:
    base = nominal(suv)[0]
    columns = [quantity(wide_cars, base)[:, 0] for key, _, quantity in WIDTHS if key not in SHARED]
    together = np.corrcoef(columns) - np.eye(len(columns))
    print(np.abs(together).max())
    assert np.abs(together).max() < 4.0 / np.sqrt(len(wide_cars))


def test_laws_are_drawn_evenly(wide_cars: NDArray[np.void]) -> None:
    cars = wide_cars
    counts = np.unique(cars["friction_law"][:, 0], return_counts=True)[1]
    expected = len(cars) / len(WIDE.friction_laws)
    assert len(counts) == len(WIDE.friction_laws) == 3
    assert counts == pytest.approx(expected, abs=4.0 * np.sqrt(expected * 2.0 / 3.0))


def test_the_nominal_draw_differs_only_where_the_file_says(suv: Plant) -> None:
    base, cars = nominal(suv)[0], cars_of(suv, NOMINAL)
    given = {key for key in Widths.model_fields if getattr(NOMINAL, key) != getattr(Widths(), key)}
    named = [row for row in WIDTHS if row[0] in given]
    assert changed(cars, base) == set().union(*(fields for _, fields, _ in named))
    for key, _, quantity in named:
        if not key.startswith("slip_stiffness"):
            check_even(quantity(cars, base), getattr(NOMINAL, key))
    for seed in SEEDS:
        for name, errors in draw_sensors(STANDARD, seed, NOMINAL).items():
            assert errors == STANDARD.get(name, type(errors)()), name


def test_friction_is_any_the_data_sheet_cannot_rule_out(suv: Plant) -> None:
    """Level 0.7 to 1.3 of the data sheet per axle, and 4 % per wheel, whatever the law."""
    levels, sides, laws = [], [], set()
    for seed in SEEDS:
        car = draw(suv, seed, WIDE)[0]
        one = draw(suv, seed, WIDE.model_copy(update={"friction_wheel": 0.0, "friction_axle": (1.0, 1.0)}))[0]
        share = car["friction_scale"] / one["friction_scale"]
        levels += [share[:2].mean(), share[2:].mean()]
        sides.append(share[0] / share[1])
        laws.add(tuple(car["friction_law"]))
    assert 0.67 < min(levels) < 0.75
    assert 1.25 < max(levels) < 1.34
    assert 0.02 < np.std(sides) < 0.05
    assert len(laws) == 3
    assert all(len(set(law)) == 1 for law in laws)


def test_linings_of_one_law_still_differ(suv: Plant) -> None:
    only = WIDE.model_copy(update={"friction_laws": ("surface",)})
    rows = [draw(suv, seed, only)[0]["friction_row"][0] for seed in range(10)]
    assert len({row.tobytes() for row in rows}) == 10


@pytest.mark.parametrize("width", [WIDE, NOMINAL], ids=["wide", "nominal"])
def test_same_seed_same_car(suv: Plant, width: Widths) -> None:
    assert draw(suv, 11, width).tobytes() == draw(suv, 11, width).tobytes() != draw(suv, 12, width).tobytes()
    assert draw_sensors(STANDARD, 3, width) == draw_sensors(STANDARD, 3, width)


def test_sensors_spread_as_the_file_says() -> None:
    cars = [draw_sensors(STANDARD, seed, WIDE) for seed in MANY]
    noise = np.array([[car[name].noise / errors.noise for name, errors in STANDARD.items()] for car in cars])
    low, high = WIDE.sensor_noise
    check_even(np.log(noise), (float(np.log(low)), float(np.log(high))))
    motors = np.array([(car["motor_torque"].noise, car["motor_torque"].scale - 1.0) for car in cars])
    check_even(motors[:, :1], WIDE.motor_torque_noise)
    check_even(motors[:, 1:], WIDE.motor_torque_scale)


@pytest.mark.parametrize(
    ("name", "zero"),
    [
        ("accel_x", WIDE.accel_zero),
        ("accel_y", WIDE.accel_zero),
        ("yaw_rate", WIDE.yaw_rate_zero),
        ("steering_angle", WIDE.steering_zero),
        ("calliper_pressure", WIDE.pressure_zero),
    ],
)
def test_a_sensor_s_zero_is_drawn_within_the_file_s_bounds(name: str, zero: float) -> None:
    assert zero > 0.0
    assert draw_sensors(STANDARD, 0, WIDE)[name].bias == (-zero, zero)


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
