"""Drives that no ordinary stop contains: wheels locked without a speed reference, reverse, lying inputs.

Of the last kind are drawn drives of a car whose brakes do what is demanded. The samples of one input at a
time, or of all, are replaced, for 2000 cycles times `FUZZ_CASES` (40) of each case. No lie may bring about
what `NEVER` lists, nor a learned value that a store would refuse.
"""

import math
import os
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.step import new_state, step
from ecu.bus.freshness import accept, begin_cycle, end_cycle, input_freshness
from ecu.contract import signals
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.records import INPUTS, OUTPUTS, new_record
from ecu.contract.signals import CYCLE_NS, INPUT, INPUT_SIGNALS, N_INPUTS, STARTING, USABLE
from ecu.jit import kernel
from ecu.recording.learned_range import out_of_range
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

CYCLE_S = 0.01


def drive(params, feed, seconds: float, quantities):
    """Return the outputs of each cycle; `quantities(t)` names the inputs, no speed reference among them."""
    state, rows = new_state(params), []
    for k in range(round(seconds / CYCLE_S)):
        inputs = feed(**quantities(CYCLE_S * k))
        for name in ("vehicle_speed", "vehicle_speed_valid"):
            inputs[0]["verdict"][INPUT[name]] = inputs[0]["new"][INPUT[name]] = 0
        outputs = new_record(OUTPUTS)
        step(params, state, inputs, outputs)
        rows.append(outputs[0].copy())
    return np.array(rows)


def wheels(speed: float, radius: float) -> dict[str, float]:
    return {f"wheel_speed_{corner}": speed / radius for corner in ("fl", "fr", "rl", "rr")}


def test_four_locked_wheels_do_not_pass_for_the_cars_speed(params, feed) -> None:
    radius, decel = float(params[0]["wheel_radius"][0]), 4.0
    body = 1.0 + GRAVITY * params[0]["pitch_gradient"]

    def sliding(t: float) -> dict[str, float]:
        if t < 2.0:
            return wheels(25.0, radius)
        pressures = {f"calliper_pressure_{corner}": 60.0 for corner in ("fl", "fr", "rl", "rr")}
        return {**wheels(0.0, radius), **pressures, "accel_x": -decel * body}

    rows = drive(params, feed, 6.0, sliding)
    assert rows["vehicle_speed"][-1] == pytest.approx(25.0 - 4.0 * decel, abs=0.5)
    assert (rows["mu_b"][-1] == rows["mu_b"][0]).all()


@pytest.mark.parametrize("sign", [-1.0, 1.0], ids=["sensors with a sign", "sensors without"])
def test_reverse_is_a_negative_speed(params, feed, sign: float) -> None:
    radius = float(params[0]["wheel_radius"][0])
    rows = drive(params, feed, 5.0, lambda t: {**wheels(sign * 4.0, radius), "reverse": 1.0})
    assert rows["vehicle_speed"][-1] == pytest.approx(-4.0, abs=0.1)


NEVER = (
    "a pressure demand that is not a number",
    "a negative pressure demand",
    "a pressure demand beyond what the brakes stand",
    "demands that count though nobody asks for any, or the ECU starts",
    "demands that do not count though somebody asks",
    "a failed ECU that demands pressure",
    "a motor demand that is not a number, negative or beyond the limit that the motor reports",
    "motor demands that count where pressures do not, or the reverse",
)
KINDS = (
    *("honest", "anywhere in its range", "stuck anywhere", "stuck", "at an end of its range", "no number"),
    *("scaled", "reversed", "drifts", "noisy", "silent", "not available at times", "from end to end"),
)
HONEST, ANYWHERE, STUCK_ANYWHERE, STUCK, END, NO_NUMBER = range(6)
SCALED, REVERSED, DRIFTS, NOISY, SILENT, GAPS, TO_AND_FRO = range(6, len(KINDS))
LOW, HIGH = (np.array([getattr(one, end) for one in INPUT_SIGNALS]) for end in ("low", "high"))
NO_NUMBERS = np.array([np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, -0.0])
HELD_S = 0.1  # an automated demand that is lost without having been withdrawn
STARTS_S = 1.0  # at most
GRIP = 9.0  # m/s^2

WORLD = np.dtype(
    [
        ("everything", "u1"),  # all inputs lie, not one
        ("speed", "f8"),
        ("decel", "f8"),
        ("pressure", "f8", (4,)),  # Pa
        ("friction", "f8", (4,)),
        ("leg_s", "f8"),  # what is left of it
        ("pedal", "f8"),
        ("automated", "f8"),
        ("backwards", "u1"),
        ("cruise", "f8"),  # m/s
        ("reference", "u1"),
        ("lie_s", "f8"),
        ("kind", "i8", (N_INPUTS,)),
        ("amount", "f8", (N_INPUTS,)),
        ("last", "f8", (N_INPUTS,)),
        ("running_s", "f8"),
        ("gap_s", "f8"),  # since the automated demand was last known, inf: it was withdrawn
    ],
    align=True,
)


@kernel
def begin_leg(world, noise):
    """Draw what driver and road do next."""
    world.leg_s = noise.uniform(0.05, 4.0)
    brakes, automated = noise.random() < 0.6, noise.random() < 0.3
    world.pedal = noise.uniform(0.0, 100.0) if brakes else 0.0
    world.automated = noise.uniform(0.0, 12.0) if automated else 0.0
    world.cruise = noise.uniform(5.0, 60.0)
    world.reference = noise.random() < 0.7
    if world.speed < 0.1:
        world.backwards = noise.random() < 0.2
    if world.backwards:
        world.cruise = min(world.cruise, 4.0)


@kernel
def begin_lie(world, noise):
    """Draw who lies next, and how."""
    world.lie_s = noise.uniform(0.05, 15.0)
    liar = noise.integers(-10, N_INPUTS)  # below 0: none
    for i in range(N_INPUTS):
        lies = i == liar or (world.everything and noise.random() < 0.5)
        world.kind[i] = noise.integers(1, len(KINDS)) if lies else HONEST
        kind = world.kind[i]
        if kind == SCALED:
            world.amount[i] = noise.uniform(0.0, 3.0)
        elif kind == DRIFTS:
            world.amount[i] = noise.uniform(-0.1, 0.1) * (HIGH[i] - LOW[i])
        elif kind == END:
            world.amount[i] = LOW[i] if noise.random() < 0.5 else HIGH[i]
        elif kind == STUCK_ANYWHERE:
            world.amount[i] = noise.uniform(LOW[i], HIGH[i])
        else:
            world.amount[i] = 0.0


@kernel
def honest(params, world, outputs, noise, place):
    """Return what a sound sensor reads, NaN: this car has none."""
    sign = 1.0 if world.backwards else -1.0
    if signals.WHEEL_SPEED <= place < signals.WHEEL_SPEED + 4:
        turning = world.speed / params.wheel_radius[place - signals.WHEEL_SPEED]
        return turning * (1.0 - 0.003 * world.decel) + 0.05 * noise.standard_normal()
    if place == signals.ACCEL_X:
        return sign * world.decel * (1.0 + GRAVITY * params.pitch_gradient) + 0.02 * noise.standard_normal()
    if signals.CALLIPER_PRESSURE <= place < signals.CALLIPER_PRESSURE + 4:
        return world.pressure[place - signals.CALLIPER_PRESSURE] / BAR + noise.standard_normal()
    if signals.MOTOR_TORQUE <= place < signals.MOTOR_TORQUE + 4:
        demand = outputs.motor_demand[place - signals.MOTOR_TORQUE]
        return demand if math.isfinite(demand) else 0.0
    if signals.MOTOR_LIMIT <= place < signals.MOTOR_LIMIT + 4:
        return 1500.0
    if place == signals.PEDAL_POSITION:
        return world.pedal
    if place == signals.PEDAL_PRESSED:
        return 1.0 if world.pedal > 0.0 else 0.0
    if place == signals.DECEL_DEMAND:
        return world.automated
    if place == signals.DECEL_DEMAND_VALID:
        return 1.0 if world.automated > 0.0 else 0.0
    if place == signals.ACCELERATOR_POSITION:
        return 20.0 if world.pedal == 0.0 and world.speed < world.cruise else 0.0
    if place == signals.REVERSE:
        return float(world.backwards)
    if place == signals.VEHICLE_SPEED:
        return world.speed if world.reference else math.nan
    if place == signals.VEHICLE_SPEED_VALID:
        return 1.0 if world.reference else math.nan
    if place == signals.ACCUMULATOR_PRESSURE:
        return 180.0
    if place == signals.HYDRAULIC_READY:
        return 1.0
    if place == signals.AMBIENT_TEMPERATURE:
        return 15.0
    if place in (signals.ACCEL_Y, signals.YAW_RATE, signals.STEERING_ANGLE):
        return 0.01 * noise.standard_normal()
    if place in (signals.ABS_ACTIVE, signals.ESP_ACTIVE, signals.RAIN):
        return 0.0
    return math.nan


@kernel
def sampled(world, true, noise, i):
    """Return the sample that arrives of an input in this cycle, inf: none."""
    kind = world.kind[i]
    if kind == ANYWHERE:
        return noise.uniform(LOW[i], HIGH[i])
    if kind in (STUCK_ANYWHERE, END):
        return world.amount[i]
    if kind == STUCK:
        return world.last[i]
    if kind == NO_NUMBER:
        return NO_NUMBERS[noise.integers(0, len(NO_NUMBERS))]
    if kind == SCALED:
        return world.amount[i] * true
    if kind == REVERSED:
        return -true
    if kind == DRIFTS:
        return true + world.amount[i] * (15.0 - world.lie_s)
    if kind == NOISY:
        return true + 0.1 * (HIGH[i] - LOW[i]) * noise.standard_normal()
    if kind == TO_AND_FRO:
        return LOW[i] if noise.random() < 0.5 else HIGH[i]
    return math.nan if kind == GAPS and noise.random() < 0.5 else true


@kernel
def advance(params, world, outputs, dt):
    """Move the car on by `dt` [s]: its callipers follow the demands, its linings have their friction."""
    force = 0.0
    for i in range(4):
        demand = BAR * outputs.pressure_demand[i] if outputs.pressure_demand_valid else 0.0
        world.pressure[i] += (1.0 - math.exp(-dt / 0.03)) * (demand - world.pressure[i])
        acts = max(world.pressure[i] - params.push_out_pressure[i], 0.0)
        torque = acts * brake_gain(params, i) * world.friction[i]
        if math.isfinite(outputs.motor_demand[i]):
            torque += outputs.motor_demand[i]
        force += torque / params.wheel_radius[i]
    world.decel = min(force / params.mass, GRIP) if world.speed > 0.0 else 0.0
    if world.pedal == 0.0 and world.automated == 0.0 and world.speed < world.cruise:
        world.decel = -3.0
    world.speed = max(world.speed - world.decel * dt, 0.0)


@kernel
def usable(inputs, place):
    return inputs.verdict[place] & USABLE == USABLE


@kernel
def somebody_asks(params, world, inputs, dt):
    """Return whether any source of a demand is known, or was a moment ago."""
    automated = usable(inputs, signals.DECEL_DEMAND) and usable(inputs, signals.DECEL_DEMAND_VALID)
    flag = inputs.value[signals.DECEL_DEMAND_VALID]
    if automated and flag > 0.5:
        world.gap_s = 0.0 if inputs.value[signals.DECEL_DEMAND] >= 0.05 else math.inf
        return True
    if usable(inputs, signals.DECEL_DEMAND_VALID) and flag < 0.5:
        world.gap_s = math.inf
    world.gap_s += dt
    arrive = inputs.verdict[signals.DECEL_DEMAND] & inputs.verdict[signals.DECEL_DEMAND_VALID] & signals.ALIVE
    held = arrive != 0 and world.gap_s < HELD_S
    return held or usable(inputs, signals.PEDAL_POSITION) or usable(inputs, signals.PEDAL_PRESSED)


@kernel
def broken(params, inputs, outputs, asked, starts):
    """Return which of `NEVER` came about in a cycle, as bits; `asked`: somebody asks for a demand."""
    found = 0
    counts, failed = outputs.pressure_demand_valid > 0.5, outputs.mode == signals.FAILED
    blends = params.blending[0] + params.blending[2] > 0.0
    for i in range(4):
        demand, motor = outputs.pressure_demand[i], outputs.motor_demand[i]
        found |= math.isnan(demand) << 0
        found |= (demand < 0.0) << 1
        found |= (demand > params.max_pressure / BAR + 1e-9) << 2
        found |= (failed and demand != 0.0) << 5
        if blends:
            limit = (
                inputs.value[signals.MOTOR_LIMIT + i] if usable(inputs, signals.MOTOR_LIMIT + i) else math.inf
            )
            found |= (not 0.0 <= motor <= limit + 1e-9) << 6
    found |= (counts and (not asked or failed or outputs.mode == STARTING)) << 3
    found |= (not counts and asked and not starts) << 4
    found |= (
        (outputs.motor_demand_valid > 0.5) != (counts and params.blending[0] + params.blending[2] > 0.0)
    ) << 7
    return found


@kernel
def cycles(params, state, world, inputs, freshness, outputs, noise, count, first):
    """Run `count` cycles; write the first cycle in which each of `NEVER` came about."""
    p, w, u, y = params[0], world[0], inputs[0], outputs[0]
    for k in range(count):
        missed = noise.integers(1, 120) if noise.random() < 0.003 else 0
        dt = 1e-9 * (CYCLE_NS * (1 + missed))
        w.leg_s, w.lie_s, w.running_s = w.leg_s - dt, w.lie_s - dt, w.running_s + dt
        if w.leg_s < 0.0:
            begin_leg(w, noise)
        if w.lie_s < 0.0:
            begin_lie(w, noise)
        for i in range(4):
            changed = w.friction[i] + 1e-3 * noise.standard_normal() * p.mu_nominal[i]
            w.friction[i] = min(max(changed, 0.7 * p.mu_nominal[i]), 1.3 * p.mu_nominal[i])
        begin_cycle(u, u.t_ns + CYCLE_NS * (1 + missed), CYCLE_NS * (1 + missed))
        for i in range(N_INPUTS):
            true = honest(p, w, y, noise, i)
            sample = sampled(w, true, noise, i)
            absent = math.isnan(true) and w.kind[i] in (HONEST, GAPS, SCALED, REVERSED, DRIFTS, NOISY)
            if w.kind[i] != SILENT and not absent:
                accept(u, freshness, i, sample, u.t_ns - 1_000_000, True)
            if w.kind[i] == HONEST and not math.isnan(true):
                w.last[i] = true
        end_cycle(u, freshness)
        asked = somebody_asks(p, w, u, dt)
        step(params, state, inputs, outputs)
        found = broken(p, u, y, asked, w.running_s <= STARTS_S + CYCLE_S)
        for bit in range(len(first)):
            if found >> bit & 1 and first[bit] < 0:
                first[bit] = k
        advance(p, w, y, dt)


class Liar:
    """A drawn drive of a car of `config/`, with one lying input at a time or with `everything` lying."""

    def __init__(self, car: str, everything: bool, observer: int = 0, law: int = 0) -> None:
        self.params = new_params(load_config(resource(f"config/{car}.toml")))
        self.params["transmit"], self.params["observer"], self.params["compensation"] = 1, observer, law
        self.noise = np.random.default_rng(1)
        self.state, self.outputs = new_state(self.params), new_record(OUTPUTS)
        self.inputs, self.world = new_record(INPUTS), new_record(WORLD)
        self.inputs["t_ns"] = 1_700_000_000_000_000_000
        self.world["everything"], self.world["gap_s"] = everything, math.inf
        self.world["friction"] = self.params["mu_nominal"]
        self.freshness = input_freshness({}, {})

    def drive(self, count: int) -> list[str]:
        """Run `count` cycles and return what went wrong, with the cycle."""
        first = np.full(len(NEVER), -1)
        args: Any = self.params, self.state, self.world, self.inputs, self.freshness, self.outputs, self.noise
        cycles(*args, count, first)
        return [f"{what}: cycle {k}" for what, k in zip(NEVER, first, strict=True) if k >= 0]

    def restart(self) -> None:
        """Begin anew with what was learned."""
        self.state = new_state(self.params, self.state["learned"].copy())
        self.world["running_s"] = 0.0

    def unkept(self) -> str:
        """Return which learned value a store would refuse, empty: none."""
        return out_of_range(self.state["learned"], self.params["mu_nominal"][0])


CYCLES = 2000 * int(os.environ.get("FUZZ_CASES", "40"))
# car, everything lies, observer, pressure law
LIARS = {
    "SUV": ("suv", False, 0, 0),
    "blended SUV": ("suv-blended", False, 0, 0),
    "sedan": ("sedan", False, 0, 0),
    "van, first observer of the thesis": ("lcv", False, 1, 0),
    "SUV, second observer of the thesis": ("suv", False, 2, 1),
    "SUV, all inputs": ("suv", True, 0, 0),
    "blended SUV, all inputs": ("suv-blended", True, 0, 0),
}


@pytest.mark.compiled
@pytest.mark.timeout(36_000)
@pytest.mark.parametrize(("car", "everything", "observer", "law"), LIARS.values(), ids=LIARS)
def test_what_no_lie_brings_about(car: str, everything: bool, observer: int, law: int) -> None:
    drive = Liar(car, everything, observer, law)
    for block in range(CYCLES // 200):
        assert drive.drive(200) == [], f"in block {block} of 200 cycles"
        assert drive.unkept() == "", f"behind block {block} of 200 cycles"
        if block % 16 == 15:
            drive.restart()
    braked, speed = drive.state[0]["learned"]["brakings"], drive.outputs[0]["vehicle_speed"]
    print(f"{CYCLES} cycles, {braked} brake applications, at last {speed:.1f} m/s")
    assert braked > CYCLES / 2000, "the car was braked"


SILENCED = {"pressure_demand_valid": 0.0, "motor_demand_valid": 0.0}
PLANTED = {
    NEVER[0]: {"pressure_demand": math.nan},
    NEVER[1]: {"pressure_demand": -1e-6},
    NEVER[2]: {"pressure_demand": 180.001},
    NEVER[3]: {"mode": STARTING},
    NEVER[4]: SILENCED,
    NEVER[5]: {"mode": signals.FAILED, **SILENCED},
    NEVER[6]: {"motor_demand": 1500.01},
    NEVER[7]: {"motor_demand_valid": 0.0},
}


def test_a_planted_violation_is_found() -> None:
    drive = Liar("suv-blended", False)
    for _ in range(20_000):
        assert drive.drive(1) == []
        if drive.outputs[0]["pressure_demand"].min() > 0.0 and not drive.world[0]["kind"].any():
            break
    sound = drive.outputs.copy()
    assert broken(drive.params[0], drive.inputs[0], sound[0], True, False) == 0
    for what, change in PLANTED.items():
        outputs = sound.copy()
        for name, value in change.items():
            outputs[name].flat[-1] = value  # of a wheel's values that of the last one
        asked = what != NEVER[5]
        assert broken(drive.params[0], drive.inputs[0], outputs[0], asked, False) == 1 << NEVER.index(what)
    assert broken(drive.params[0], drive.inputs[0], sound[0], False, False) == 1 << 3, "nobody asks"
    assert drive.unkept() == ""
    drive.state["learned"]["observed_s"], drive.state["learned"]["mu_b"][0, 2] = 1.0, 0.9
    assert drive.unkept() == "mu_b"
