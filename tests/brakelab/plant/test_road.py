"""The road by place: tables, patches, split friction, bumps that meet one axle after the other."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.driver import Script, friction_now, grade_now
from brakelab.plant.records import PHASE
from brakelab.plant.road import LEVEL, Road, set_road, value_at
from brakelab.plant.vehicle import STEP, advance

FRONT, REAR = 1.29, 1.375


def road(friction: Any = (), height: Any = (), grade: Any = (), bank: Any = ()) -> Road:
    def table(rows: Any, columns: int) -> Any:
        return np.array(rows, np.float64).reshape(-1, columns)

    return Road(table(friction, 3), table(height, 3), table(grade, 2), table(bank, 2))


def drive_over(car: Any, where: Road, seconds: float, watch: Callable[[Any], None] | None = None) -> None:
    for _ in range(round(seconds / STEP)):
        set_road(where, car.params[0], car.now, car.commands[0])
        advance(car.params[0], car.now, car.commands[0], STEP)
        if watch is not None:
            watch(car.now)


@pytest.mark.parametrize("rows", [1, 2, 3, 8, 31])
def test_tables_are_linear_between_rows_and_constant_outside(rows: int) -> None:
    random = np.random.default_rng(rows)
    table = np.column_stack([np.cumsum(random.uniform(0.1, 9.0, rows)), random.normal(size=(rows, 2))])
    for place in (*np.linspace(-5.0, table[-1, 0] + 5.0, 200), *table[:, 0]):
        for column in (1, 2):
            expected = np.interp(place, table[:, 0], table[:, column])
            assert value_at(table, place, column) == pytest.approx(expected)


def test_each_wheel_meets_a_patch_when_it_gets_there(car_at: Callable[[float], Any]) -> None:
    car = car_at(10.0)
    patch = road(friction=[[0.0, 1.2, 1.2], [5.0, 1.2, 1.2], [5.001, 0.2, 0.7]])
    met: dict[int, float] = {}

    def watch(state: Any) -> None:
        for wheel in range(4):
            if car.commands["road_friction"][0, wheel] < 1.0:
                met.setdefault(wheel, float(state["distance"]))

    drive_over(car, patch, 1.0, watch)
    assert [met[wheel] for wheel in range(4)] == pytest.approx([5 - FRONT] * 2 + [5 + REAR] * 2, abs=0.02)
    assert car.commands["road_friction"][0] == pytest.approx([0.2, 0.7, 0.2, 0.7])


def test_what_is_not_described_by_place_is_left_alone(car_at: Callable[[float], Any]) -> None:
    car = car_at(10.0)
    car.commands["grade"], car.commands["bank"], car.commands["road_friction"] = 0.03, 0.02, 0.9
    drive_over(car, LEVEL, 0.1)
    assert (car.commands["grade"], car.commands["bank"]) == (0.03, 0.02)
    assert np.all(car.commands["road_friction"] == 0.9)


@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_a_split_road_turns_the_car_to_its_dry_side(shipped: Callable[[str, float], Any], name: str) -> None:
    car = shipped(name, 20.0)
    car.press(60.0, 60.0)
    drive_over(car, road(friction=[[0.0, 1.2, 0.2]]), 0.4)
    left, right = car.now["force_x"][::2].sum(), car.now["force_x"][1::2].sum()
    assert left < 2.0 * right < 0.0
    assert car.now["yaw_rate"] > 0.05
    assert car.now["accel_x"] < -2.0


def test_a_bump_lifts_the_front_axle_first(shipped: Callable[[str, float], Any]) -> None:
    car = shipped("suv14", 10.0)
    bump = [[4.0, 0.0, 0.0], [4.2, 0.03, 0.03], [4.6, 0.03, 0.03], [4.8, 0.0, 0.0]]
    seen: list[tuple[float, float, float]] = []

    def watch(state: Any) -> None:
        load = state["wheel_load"]
        seen.append((float(state["distance"]), float(load[0]), float(load[2])))

    drive_over(car, road(height=bump), 1.5, watch)
    rows = np.array(seen)
    first = [rows[np.argmax(rows[:, column] > 1.2 * rows[0, column]), 0] for column in (1, 2)]
    assert first[0] == pytest.approx(4.0 - FRONT, abs=0.15)
    assert first[1] == pytest.approx(4.0 + REAR, abs=0.15)
    assert car.now["roll"] == 0.0


@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_a_hill_by_place_slows_the_car_from_there_on(shipped: Callable[[str, float], Any], name: str) -> None:
    car = shipped(name, 20.0)
    car.params["drag_factor"] = car.params["rolling_resistance"] = 0.0
    hill = road(grade=[[20.0, 0.0], [20.001, 0.1]])
    drive_over(car, hill, 1.0)
    assert float(car.now["speed_x"]) == pytest.approx(20.0, abs=0.01)
    drive_over(car, hill, 1.0)
    assert float(car.now["speed_x"]) == pytest.approx(20.0 - 9.81 * np.sin(0.1) * 0.976, abs=0.03)


@pytest.mark.parametrize("name", ["suv", "suv14"])
def test_a_banked_road_pulls_the_car_down_its_side(shipped: Callable[[str, float], Any], name: str) -> None:
    car = shipped(name, 20.0)
    drive_over(car, road(bank=[[0.0, 0.05]]), 1.5)
    assert car.now["speed_y"] < 0.0  # the left side is high
    assert np.all(car.now["wheel_load"][1::2] > car.now["wheel_load"][::2])


def test_a_script_reads_place_before_time(car_at: Callable[[float], Any]) -> None:
    by_time = np.array([[0.0, 0.9]]), np.array([[0.0, 0.01]])
    state = car_at(0.0).now
    state["distance"] = 50.0
    plain = Script(np.zeros(1, PHASE), *by_time, 20.0, False)
    assert (friction_now(plain, state), grade_now(plain, state)) == (0.9, 0.01)
    placed = plain._replace(road=road(friction=[[0.0, 1.0, 0.2]], grade=[[0.0, 0.0], [100.0, 0.1]]))
    assert (friction_now(placed, state), grade_now(placed, state)) == pytest.approx((0.6, 0.05))
