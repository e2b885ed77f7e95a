"""Cross-checks: what they hand on to each other, and inputs that are masked, replaced or corrected."""

import math

import numpy as np
import pytest

from ecu.algorithm.monitoring.accel_error import STOOD_S
from ecu.algorithm.monitoring.lateness import WHEELS
from ecu.algorithm.monitoring.sensors import mask_implausible, watch_sensors
from ecu.algorithm.monitoring.speeds import BASE_S, FOUND_S
from ecu.algorithm.step import new_state
from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import (
    ACCEL_X,
    CALLIPER_PRESSURE,
    CORNERS,
    HYDRAULIC_READY,
    INPUT,
    MOTOR_TORQUE,
    USABLE,
    VEHICLE_SPEED,
    WHEEL_SPEED,
)

MODEL, ZERO, READING = 20.0, 0.5, 23.0  # bar
FL, RR = 0, 3


class Inputs:
    """Sound inputs of a car that brakes by this ECU's demands; `mask` runs what is tested."""

    def __init__(self, params, feed, armed: bool = True) -> None:
        params["transmit"] = armed
        self.params, self.state = params[0], new_state(params)[0]
        self.inputs = feed(
            accel_x=-4.0, wheel_speed=60.0, calliper_pressure=READING, hydraulic_ready=1.0, motor_torque=100.0
        )
        self.state["plausibility"]["sent"] = self.state["application"]["braking"] = 1
        self.state["hydraulics"]["model"], self.state["estimate"]["pressure_zero"] = MODEL, ZERO
        self.state["pressures"]["honest"] = 1

    def lose(self, *places: int) -> None:
        for place in places:
            self.inputs[0]["verdict"][place] = self.inputs[0]["new"][place] = 0
            self.inputs[0]["age_ns"][place] = 500_000_000

    def mask(self) -> None:
        mask_implausible(self.params, self.state, self.inputs[0])

    def usable(self, place: int) -> bool:
        row = self.inputs[0]
        return bool(row["verdict"][place] & USABLE == USABLE and row["new"][place])

    def left_out(self) -> list[int]:
        return np.flatnonzero(self.state["witness"]["published"]["rejected"]).tolist()


@pytest.fixture
def inputs(params, feed) -> Inputs:
    return Inputs(params, feed)


def test_sound_inputs_pass_as_they_are(inputs) -> None:
    before = inputs.inputs.copy()
    inputs.mask()
    assert inputs.inputs == before
    assert inputs.left_out() == []


@pytest.mark.parametrize("name", sorted(IMPLAUSIBLE))
def test_an_input_that_the_others_contradict_is_left_out(inputs, name) -> None:
    inputs.state["witness"]["rejected"][INPUT[name]] = 1
    inputs.mask()
    others = [INPUT[other] for other in IMPLAUSIBLE if other != name]
    assert inputs.usable(INPUT[name]) == name.startswith("calliper_pressure"), "the model's stands for it"
    assert all(inputs.usable(place) for place in others)
    assert inputs.left_out() == [INPUT[name]]


def test_a_shadow_leaves_nothing_out_by_torques_that_another_makes(params, feed) -> None:
    inputs = Inputs(params, feed, armed=False)
    inputs.state["witness"]["rejected"][:] = 1
    inputs.state["acceleration"]["implausible"] = 1
    inputs.state["accel_error"]["zero_off"] = 1.0
    before = inputs.inputs.copy()
    inputs.mask()
    assert inputs.inputs == before


ACCELEROMETERS = [
    # case, reading, implausible, reported, zero off, scale off, what is left of it
    ("sound", -4.0, 0, 0, 0.0, 0.0, -4.0),
    ("its zero is known to be off", -4.0, 0, 1, -0.5, 0.0, -3.5),
    ("its scale is", -4.0, 0, 1, 0.0, 0.25, -3.2),
    ("both", -4.0, 0, 0, 1.0, 0.25, -4.0),
    ("it errs, and nobody knows how", -4.0, 0, 1, 0.0, 0.0, math.nan),
    ("it contradicts the others", -4.0, 1, 0, 0.0, 0.0, math.nan),
    ("beyond its range", -60.0, 0, 0, 0.0, 0.0, math.nan),
    ("beyond it, forwards", 60.0, 0, 0, 0.0, 0.0, math.nan),
]


@pytest.mark.parametrize(
    ("case", "reading", "implausible", "reported", "zero", "scale", "left"),
    ACCELEROMETERS,
    ids=[row[0] for row in ACCELEROMETERS],
)
def test_the_accelerometer_is_corrected_by_what_is_known_of_its_error(
    inputs, feed, case, reading, implausible, reported, zero, scale, left
) -> None:
    feed(inputs.inputs, accel_x=reading)
    inputs.state["acceleration"]["implausible"] = implausible
    error = inputs.state["accel_error"]
    error["reported"], error["zero_off"], error["scale_off"] = reported, zero, scale
    inputs.mask()
    assert inputs.usable(ACCEL_X) == math.isfinite(left), case
    assert (ACCEL_X in inputs.left_out()) == math.isnan(left)
    if math.isfinite(left):
        assert inputs.inputs[0]["value"][ACCEL_X] == pytest.approx(left)


@pytest.mark.parametrize("i", [FL, RR])
def test_a_wheel_speed_that_fell_as_no_wheel_can_is_left_out(inputs, i) -> None:
    inputs.state["plausibility"]["fell"][i] = 1
    inputs.mask()
    assert inputs.left_out() == [WHEEL_SPEED + i]


@pytest.mark.parametrize(("lag", "sigma", "aged_ms"), [(0.2, 0.01, 200), (0.04, 0.01, 0), (0.2, 0.1, 0)])
def test_a_vehicle_speed_that_is_late_is_as_old_as_it_is(inputs, lag, sigma, aged_ms) -> None:
    """A lag counts from 50 ms, and from two standard deviations more than 30 ms."""
    lateness = inputs.state["speeds"]["lateness"]
    lateness["lag"][WHEELS], lateness["p"][WHEELS, 0] = lag, sigma**2
    before = int(inputs.inputs[0]["age_ns"][VEHICLE_SPEED])
    inputs.mask()
    assert inputs.inputs[0]["age_ns"][VEHICLE_SPEED] - before == aged_ms * 1_000_000


CALLIPERS = [CALLIPER_PRESSURE + i for i in range(4)]
ALL_LOST = (*CALLIPERS, HYDRAULIC_READY)
WRONG, LATER, FAILED = ("pressures", "wrong"), ("plausibility", "apart_s"), ("failed_brakes", "failed")
BY_MODEL, AS_IT_IS, LEFT_OUT = "by the model", "as it is", "left out"
PRESSURES = [
    # case, lost, field of the state and its value at one wheel, sent, ABS, what becomes of its reading
    ("sound", (), WRONG, 0, 1, 0, AS_IT_IS),
    ("lost", (CALLIPER_PRESSURE + RR,), WRONG, 0, 1, 0, BY_MODEL),
    ("all pressures lost, the unit is heard", tuple(CALLIPERS), WRONG, 0, 1, 0, BY_MODEL),
    ("all lost, nobody hears the unit", ALL_LOST, WRONG, 0, 1, 0, AS_IT_IS),
    ("lost while nothing valid is sent", (CALLIPER_PRESSURE + RR,), WRONG, 0, 0, 0, AS_IT_IS),
    ("lost while ABS sets the pressure", (CALLIPER_PRESSURE + RR,), WRONG, 0, 1, 1, AS_IT_IS),
    ("lost of a brake that has failed", (CALLIPER_PRESSURE + RR,), FAILED, 1, 1, 0, AS_IT_IS),
    ("wrong", (), WRONG, 1, 1, 0, BY_MODEL),
    ("wrong while ABS sets the pressure", (), WRONG, 1, 1, 1, LEFT_OUT),
    ("off its demand for 40 ms", (), LATER, 0.04, 1, 0, BY_MODEL),
    ("off its demand for 20 ms", (), LATER, 0.02, 1, 0, AS_IT_IS),
]


@pytest.mark.parametrize(
    ("case", "lost", "field", "value", "sent", "abs_active", "becomes"),
    PRESSURES,
    ids=[row[0] for row in PRESSURES],
)
def test_a_pressure_that_is_wrong_or_lost_is_that_of_the_demand(
    inputs, feed, case, lost, field, value, sent, abs_active, becomes
) -> None:
    inputs.lose(*lost)
    feed(inputs.inputs, abs_active=abs_active)
    inputs.state[field[0]][field[1]][RR] = value
    inputs.state["plausibility"]["sent"] = sent
    place, row = CALLIPER_PRESSURE + RR, inputs.inputs[0]
    inputs.mask()
    by_model = becomes == BY_MODEL
    assert row["value"][place] == (MODEL + ZERO if by_model else READING), case
    assert inputs.usable(place) == (by_model or (becomes == AS_IT_IS and place not in lost))
    assert not (by_model and row["age_ns"][place]), "the model is of this cycle"
    assert (place in inputs.left_out()) == (becomes != AS_IT_IS)
    if place not in lost:
        assert row["value"][CALLIPER_PRESSURE + FL] == READING, "no other one is touched"


# 16 bar and 0.2 of the model's 20 are what noise never is; of a lasting 3 bar 0.61 / 3 stay
LASTS = 3.0 - (0.6**2 + (0.025 * MODEL) ** 2) / 3.0
READINGS = [
    # case, reading, lasting offset [bar], none below zero, the deceleration agrees, what is left
    ("as the model", 20.5, 0.0, 0, 0, 20.5),
    ("what lasts is taken out", 23.0, 3.0, 0, 0, 23.0 - LASTS),
    ("not where the deceleration agrees with it", 23.0, 3.0, 0, 1, 23.0),
    ("below zero", 1.0, 3.0, 0, 0, 1.0 - LASTS),
    ("of a sensor that has no sign", 1.0, 3.0, 1, 0, 0.0),
    ("above the model by 19.5 bar", 40.0, 0.0, 0, 0, 40.0),
    ("by 20.5 bar: no noise", 41.0, 0.0, 0, 0, MODEL + ZERO),
    ("by 20.5 bar, and the deceleration agrees", 41.0, 0.0, 0, 1, 41.0),
]


@pytest.mark.parametrize(
    ("case", "reading", "offset", "floored", "honest", "left"), READINGS, ids=[row[0] for row in READINGS]
)
def test_a_pressure_reading_counts_less_what_lasts_of_its_difference_from_the_demand(
    inputs, feed, case, reading, offset, floored, honest, left
) -> None:
    feed(inputs.inputs, calliper_pressure=reading)
    inputs.state["pressures"]["offset"], inputs.state["pressures"]["honest"] = offset, honest
    inputs.state["estimate"]["floored"] = floored
    inputs.mask()
    got = inputs.inputs[0]["value"][CALLIPER_PRESSURE : CALLIPER_PRESSURE + 4]
    assert got == pytest.approx([left] * 4), case


MOTORS = [
    # case, blended, lost, rejected, braking, torque that counts [N m]
    ("heard", 0.7, False, False, 1, 100.0),
    ("lost: what it was asked for", 0.7, True, False, 1, 250.0),
    ("lost, and never asked", 0.0, True, False, 1, 100.0),
    ("contradicted", 0.7, False, True, 1, 250.0),
    ("contradicted while nobody brakes", 0.7, False, True, 0, 100.0),
]


@pytest.mark.parametrize(
    ("case", "blended", "lost", "rejected", "braking", "torque"), MOTORS, ids=[row[0] for row in MOTORS]
)
def test_a_motor_that_is_not_heard_gives_what_it_was_asked_for(
    inputs, case, blended, lost, rejected, braking, torque
) -> None:
    inputs.params["blending"] = blended
    inputs.state["application"]["braking"] = braking
    inputs.state["blending"]["asked"][0, RR] = 250.0
    if lost:
        inputs.lose(MOTOR_TORQUE + RR)
    inputs.state["witness"]["rejected"][MOTOR_TORQUE + RR] = rejected
    inputs.mask()
    assert inputs.inputs[0]["value"][MOTOR_TORQUE + RR] == torque, case
    assert inputs.inputs[0]["value"][MOTOR_TORQUE + FL] == 100.0
    assert [f"motor_torque_{CORNERS[RR]}"] == [n for n in INPUT if INPUT[n] == MOTOR_TORQUE + RR]


@pytest.mark.parametrize(("stood_s", "rolled_s"), [(STOOD_S - 1.0, BASE_S), (STOOD_S + 1.0, FOUND_S)])
def test_who_gets_in_while_the_car_stands_presses_its_tyres(params, feed, stood_s, rolled_s) -> None:
    """The radii that were found are then less certain."""
    state = new_state(params)[0]
    state["estimate"]["started"] = state["estimate"]["torques_known"] = 1
    state["accel_error"]["stood_s"], state["speeds"]["rolled_s"] = stood_s, BASE_S
    watch_sensors(params[0], state, feed()[0], 0.01)
    assert state["speeds"]["rolled_s"] == rolled_s
