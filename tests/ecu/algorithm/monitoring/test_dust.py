"""Dust on board: closed forms of a stop, what is not counted, life totals, other models, mass by wear."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.monitoring.dust import DUST_STATE, restore_dust, update_dust
from ecu.algorithm.monitoring.emission_factor import emission_factor
from ecu.algorithm.step import new_state
from ecu.contract.dust import LAW, LAW_TERMS, NONE
from ecu.contract.signals import CALLIPER_PRESSURE, USABLE
from ecu.settings.config import load_config, new_params
from ecu.settings.dust import Dust, set_dust, set_dust_version

DT = 0.01  # s
RADIUS = 0.35  # m
MODEL = Dust(
    model="law",
    numbers=[4.0, 0.9, 0.5, *[0.0] * (LAW_TERMS - 2)],
    low=[2.0, 0.05, 30.0, -20.0, 0.5, 1.0],
    high=[40.0, 40.0, 1500.0, 200.0, 30.0, 60.0],
    factor=1.2,
    below=-0.5,
    above=0.4,
)


class Car:
    """Four equal brakes with given speed, torque, temperature and pressure."""

    def __init__(self, params, feed, front: Dust | None = MODEL, rear: Dust | None = None) -> None:
        self.params = params.copy()
        for corner, dust in enumerate((front, front, rear, rear)):
            set_dust(self.params[0], corner, dust)
        set_dust_version(self.params[0])
        self.p, self.inputs = self.params[0], feed()
        self.s = new_state(self.params)[0]

    @property
    def kept(self) -> Any:
        return self.s["learned"]["dust"]

    def cycle(self, speed: float, torque: float, heat: float, pressure: float) -> None:
        s, u = self.s, self.inputs[0]
        s["estimate"]["brake_torque"], s["estimate"]["speed"] = torque, speed
        s["discs"]["temperature"] = heat
        s["discs"]["power"] = torque * speed / RADIUS
        u["value"][CALLIPER_PRESSURE : CALLIPER_PRESSURE + 4] = pressure
        u["verdict"][CALLIPER_PRESSURE : CALLIPER_PRESSURE + 4] |= USABLE
        update_dust(
            self.p, s["dust"], s["learned"], u, s["estimate"], s["discs"], s["wear"], s["application"], DT
        )  # fmt: skip

    def stop(
        self,
        first: float = 20.0,
        last: float = 10.0,
        seconds: float = 5.0,
        stands: float = 0.0,
        **given: float,
    ) -> Any:  # fmt: skip
        """Brake from speed to speed; return the state after it."""
        values = {"torque": 500.0, "heat": 90.0, "pressure": 20.0, **given}
        application = self.s["application"]
        application["started"], application["ended"] = 1, 0
        application["braking"] = 1
        for k in range(round(seconds / DT)):
            self.cycle(first + (last - first) * (k + 0.5) * DT / seconds, **values)
            application["started"] = 0
        for _ in range(round(stands / DT)):
            self.cycle(0.0, **values)
        application["ended"], application["braking"] = 1, 0
        self.cycle(last, 0.0, values["heat"], 0.0)
        application["ended"] = 0
        return self.s["dust"]

    def roll(self, metres: float) -> None:
        for _ in range(1000):
            self.cycle(metres / 1000 / DT, 0.0, 20.0, 0.0)


@pytest.fixture
def car(params, feed) -> Car:
    return Car(params, feed)


def by_hand(torque: float = 500.0, v: float = 15.0, seconds: float = 5.0) -> float:
    return 10.0 ** (4.0 + 0.9 * math.log10(torque * v * seconds) + 0.5 * math.log10(v))


def test_particles_of_a_stop_are_those_of_both_front_brakes(car):
    got = car.stop()
    assert got["particles"] == pytest.approx(2.0 * 1.2 * by_hand(), rel=2e-3)
    assert got["low"] == pytest.approx(2.0 * by_hand() * 10**-0.5, rel=2e-3)
    assert got["high"] == pytest.approx(2.0 * by_hand() * 10**0.4, rel=2e-3)


def test_means_are_those_of_the_moving_car(car):
    """A car that is held after its stop emits as if it were released."""
    got = car.stop(20.0, 0.6, 5.0)["particles"]
    assert car.stop(20.0, 0.6, 5.0, stands=30.0)["particles"] == pytest.approx(got, rel=1e-9)
    features = car.s["dust"]["features"][0]
    push_out = 1e-5 * car.p["push_out_pressure"][0]
    expected = [20.0, 0.6, 500.0, 90.0, 5.0, 20.0 - push_out]
    assert features == pytest.approx(np.array(expected), abs=0.03)


NOT_COUNTED = {
    "hotter than any trip": {"heat": 400.0},
    "faster": {"first": 60.0, "last": 50.0},
    "stronger": {"torque": 3000.0},
    "longer": {"seconds": 60.0},
}


@pytest.mark.parametrize("given", NOT_COUNTED.values(), ids=NOT_COUNTED)
def test_outside_what_it_was_trained_on_nothing_is_counted(car, given):
    car.stop()
    particles, told_work = float(car.kept["particles"]), float(car.kept["told_work"])
    state = car.stop(**given)
    assert np.isnan([state["particles"], state["low"], state["high"]]).all()
    assert car.kept["particles"] == particles
    assert car.kept["told_work"] == told_work < car.kept["work"]
    car.roll(2000.0)
    car.stop()
    assert math.isfinite(car.s["dust"]["particles"])
    if car.kept["told_work"] < 0.9 * car.kept["work"]:
        assert math.isnan(car.s["dust"]["per_km"])


def test_a_lost_pressure_tells_nothing(car):
    application = car.s["application"]
    car.inputs[0]["verdict"][CALLIPER_PRESSURE] = 0
    application["started"] = application["braking"] = 1
    for _ in range(300):
        s, u = car.s, car.inputs[0]
        s["estimate"]["brake_torque"], s["estimate"]["speed"] = 500.0, 15.0
        s["discs"]["temperature"] = 90.0
        s["discs"]["power"] = 500.0 * 15.0 / RADIUS
        u["verdict"][CALLIPER_PRESSURE] = 0
        update_dust(
            car.p, s["dust"], s["learned"], u, s["estimate"], s["discs"], s["wear"], application, DT
        )  # fmt: skip
        application["started"] = 0
    application["ended"], application["braking"] = 1, 0
    car.cycle(15.0, 0.0, 90.0, 0.0)
    assert math.isnan(car.s["dust"]["particles"])


def test_what_is_only_felt_is_not_counted(car):
    got = car.stop(torque=2.0)
    assert math.isnan(got["particles"])
    assert car.kept["work"] == 0.0


def test_per_kilometre_is_the_life_s_sum_over_its_way(car):
    for _ in range(5):
        car.stop()
        car.roll(1000.0)
    got = car.stop()
    distance = 5 * 1000.0 + 6 * 75.0
    assert car.kept["way"] == pytest.approx(distance, rel=1e-3)
    assert got["per_km"] == pytest.approx(1e3 * 6 * got["particles"] / distance, rel=2e-3)
    assert car.kept["applications"] == 6


def test_a_car_without_a_model_tells_nothing(params, feed):
    car = Car(params, feed, None)
    got = car.stop()
    assert np.isnan([got["particles"], got["low"], got["per_km"]]).all()
    assert list(car.p["dust_model"]) == [NONE] * 4


def test_both_axles_add_up(params, feed):
    front, both = Car(params, feed), Car(params, feed, MODEL, MODEL)
    assert both.stop()["particles"] == pytest.approx(2.0 * front.stop()["particles"])


def again(car: Car) -> Any:
    state = np.zeros(1, DUST_STATE)[0]
    restore_dust(car.p, state, car.s["learned"], car.s["wear"])
    return state


def test_life_goes_on_after_a_restart(car):
    for _ in range(3):
        car.stop()
        car.roll(1000.0)
    car.stop()
    assert again(car)["per_km"] == car.s["dust"]["per_km"]
    assert math.isnan(again(car)["particles"])  # of the last application


def test_other_models_count_anew(car):
    car.stop()
    car.roll(2000.0)
    other = MODEL.model_copy(update={"factor": 1.3})
    for corner in (0, 1):
        set_dust(car.p, corner, other)
    set_dust_version(car.p)
    again(car)
    assert (car.kept["particles"], car.kept["way"], car.kept["applications"]) == (0.0, 0.0, 0)


def test_mass_is_what_stays_in_the_air_of_what_was_worn_off(car):
    wear = car.s["learned"]["wear"]
    wear["odometer"], wear["regressors"][0] = 1000e3, [10.0, 10.0, 4.0, 4.0] / car.p["wear_law"][0]
    wear["fitted_at"] = [0.0, 0.0, 500e3, 500e3]
    assert list(car.p["airborne_share"]) == [0.5] * 4
    assert again(car)["mass_per_km"] == pytest.approx(2 * 5.0 + 2 * 4.0)
    wear["fitted_at"] = [0.0, 0.0, 999e3, 999e3]  # new pads: not yet known
    assert math.isnan(again(car)["mass_per_km"])


BAD = {
    "too few numbers": ({"numbers": [1.0, 2.0]}, "a law has 11 finite numbers"),
    "a range the wrong way": ({"low": [50.0, 0, 0, 0, 0, 0]}, "low must not exceed high"),
    "an interval above": ({"below": 0.5}, "below"),
    "a model nobody has": ({"model": "forest"}, "model"),
}


@pytest.mark.parametrize(("given", "said"), BAD.values(), ids=BAD)
def test_a_configuration_that_cannot_be(given, said):
    with pytest.raises(ValueError, match=said):
        Dust.model_validate({**MODEL.model_dump(), **given}, strict=False)


def test_shipped_cars_have_no_model_of_their_own():
    for path in (Path(__file__).parents[3] / "config").glob("*.toml"):
        assert (new_params(load_config(path))[0]["dust_model"] == NONE).all()


def test_the_law_of_this_file_is_that_of_the_kernel():
    x = np.array([20.0, 10.0, 500.0, 90.0, 5.0, 20.0])
    assert 10.0 ** emission_factor(LAW, np.array(MODEL.numbers), x) == pytest.approx(by_hand())
