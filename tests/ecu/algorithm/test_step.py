"""The whole algorithm: same inputs give the same bits, promised outputs are never NaN, a value that is not
finite is survived and reported, and the cycle allocates nothing."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from numba.core.runtime import rtsys
from numba.core.runtime._nrt_python import memsys_enable_stats

from ecu.algorithm.step import STATE, initial_part, new_state, resume, step
from ecu.contract.faults import (
    ACCUMULATOR_LOW,
    BRAKE_FADE,
    DEMAND_LIMITED,
    IMPLAUSIBLE,
    REQUEST_LOST,
    WHEEL_SLIPS,
)
from ecu.contract.params import OFF
from ecu.contract.records import OUTPUTS, output_vector
from ecu.contract.signals import (
    ACTIVE,
    ALIVE,
    CORNERS,
    DEGRADED,
    FAILED,
    FAULT,
    HOLDING,
    INPUT,
    OBSERVING,
    OUTPUT_COLUMNS,
    READY,
    USABLE,
)

G, DT = 9.81, 0.01
BAR = 1e5
PEAK = 1.3  # adhesion of the car's tyres
SEEN = (  # inputs of a car with everything but a speed reference
    *(f"wheel_speed_{c}" for c in CORNERS),
    *(f"calliper_pressure_{c}" for c in CORNERS),
    *(f"motor_torque_{c}" for c in CORNERS),
    "accel_x",
    "accel_y",
    "yaw_rate",
    "steering_angle",
    "pedal_position",
    "decel_demand",
)
# NaN here: the car does not blend, has no emission model; a test ratio or a lateness needs its measurement.
NOT_BUILT = (
    "motor_demand_",
    "particle",
    "test_ratio",
    "pressure_lateness",
)  # ratios: of what was fused alone
PROMISED = [k for k, name in enumerate(OUTPUT_COLUMNS) if not name.startswith(NOT_BUILT)]


class Car:
    """An ideal car on a straight road that does what the pedal asks for; `mu` of its linings."""

    def __init__(self, params, feed, seed: int = 0, mu: float = 0.40, reference: bool = False) -> None:
        self.params, self.feed, self.mu, self.reference = params, feed, mu, reference
        self.p, self.inputs, self.outputs = params[0], feed(), np.zeros(1, OUTPUTS)
        self.random, self.state = np.random.default_rng(seed), new_state(params)
        self.state["learned"]["wear"]["told"] = 1  # what is left of other pads nobody knows
        self.speed, self.decel, self.t = 25.0, 0.0, 0
        self.overwrite: dict[str, float] = {}

    def wheels(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the wheel speeds [rad/s] and the pressures [bar] that go with the deceleration."""
        p, a = self.p, self.decel
        tyres = a - p["drag_area"] * self.speed**2 / p["mass"]
        front = (p["rear_axle"] + tyres / G * p["cog_height"]) / p["wheelbase"]
        share = 0.5 * np.array([front, front, 1 - front, 1 - front])
        load = share * p["mass"] * G
        force = -share * (p["mass"] * a - p["drag_area"] * self.speed**2)
        stiffness = p["slip_stiffness"] * load * (load / p["static_load"]) ** -p["stiffness_degression"]
        height = p["unloaded_radius"] - load / p["vertical_stiffness"]
        half_chord = np.sqrt(p["unloaded_radius"] ** 2 - height**2)
        radius = half_chord / np.arctan2(half_chord, height)  # (A.4)
        rolling = p["rolling_resistance"] * load * radius
        torque = -force * radius - rolling + p["wheel_inertia"] * a / radius
        acts = np.maximum(torque / (2 * p["piston_area"] * p["effective_radius"] * self.mu), 0.0)
        pressure = acts + p["push_out_pressure"] if a > 0 else np.zeros(4)
        used = np.abs(force) / (PEAK * load)
        slip = np.sign(force) * 3 * PEAK * load / stiffness * (1 - np.cbrt(1 - used))  # brush tyre
        return self.speed * (1 + slip) / radius, pressure / BAR

    def cycle(self, pedal: float) -> np.ndarray:
        """Run one cycle and return the outputs."""
        asked = np.interp(pedal, self.p["pedal_position"], self.p["pedal_decel"])
        self.decel += float(np.clip(asked - self.decel, -0.3, 0.3))
        self.speed = max(self.speed - self.decel * DT, 0.0)
        omega, pressure = self.wheels()
        noise = self.random.standard_normal
        self.feed(
            self.inputs,
            wheel_speed=omega + 0.1 * noise(4),
            calliper_pressure=pressure + 0.2 * noise(4),
            accel_x=-self.decel * (1 + G * self.p["pitch_gradient"]) + 0.01 * noise(),
            pedal_position=pedal,
            pedal_pressed=float(pedal > 1),
            hydraulic_ready=1.0,
            accumulator_pressure=180.0,
            motor_torque=0.0,
            accel_y=0.0,
            yaw_rate=0.0,
            steering_angle=0.0,
            decel_demand=0.0,
        )
        fresh = self.inputs[0]["new"]
        fresh[INPUT["vehicle_speed"]] = self.reference
        self.feed(self.inputs, vehicle_speed=self.speed, vehicle_speed_valid=float(self.reference))
        self.feed(self.inputs, **self.overwrite)
        self.t += 1
        self.inputs["t_ns"] = self.t * 10_000_000
        step(self.params, self.state, self.inputs, self.outputs)
        return output_vector(self.outputs).copy()

    def drive(self, *legs: tuple[float, float]) -> np.ndarray:
        """Run legs of (pedal, seconds) and return every cycle's outputs."""
        return np.array([self.cycle(pedal) for pedal, seconds in legs for _ in range(round(seconds / DT))])


@pytest.fixture
def car(params, feed) -> Car:
    return Car(params, feed)


STOP = ((0.0, 2.0), (60.0, 3.0), (0.0, 1.0))


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, OUTPUT_COLUMNS.index(name)]


def test_the_same_inputs_give_the_same_bits(params, feed) -> None:
    first, second = Car(params, feed, seed=1), Car(params, feed, seed=1)
    assert first.drive(*STOP).tobytes() == second.drive(*STOP).tobytes()
    assert first.state.tobytes() == second.state.tobytes()


def test_parameters_and_inputs_are_only_read(car: Car) -> None:
    car.drive((60.0, 1.0))
    before = car.params.tobytes(), car.inputs.tobytes()
    step(car.params, car.state, car.inputs, car.outputs)
    assert (car.params.tobytes(), car.inputs.tobytes()) == before


def test_what_outputs_held_before_does_not_matter(params, feed) -> None:
    clean, dirty = Car(params, feed, seed=1), Car(params, feed, seed=1)
    for _ in range(100):
        output_vector(dirty.outputs)[:] = 1e9
        assert clean.cycle(60.0).tobytes() == dirty.cycle(60.0).tobytes()


@pytest.mark.parametrize("mu", [0.36, 0.45, 0.54])
@pytest.mark.parametrize("reference", [False, True])
def test_a_stop_teaches_the_friction_of_the_linings(params, feed, mu: float, reference: bool) -> None:
    car = Car(params, feed, mu=mu, reference=reference)
    rows = car.drive((0.0, 10.0), (60.0, 4.0))
    assert column(rows, "mode")[-1] == ACTIVE
    found = [column(rows, f"mu_b_{c}")[-1] for c in CORNERS]
    modes = [column(rows, f"mode_{c}")[-1] for c in CORNERS]
    print(f"true {mu}: found {np.round(found, 3)}")
    assert modes == [OBSERVING] * 4
    assert found == pytest.approx([mu] * 4, rel=0.06)
    assert column(rows, "vehicle_speed")[-1] == pytest.approx(car.speed, abs=0.3)
    # sigma is honest: nobody is off by more than three of them
    sigma = [column(rows, f"sigma_mu_b_{c}")[-1] for c in CORNERS]
    assert all(abs(f - mu) < 3 * s for f, s in zip(found, sigma, strict=True))


def test_signs_of_the_contract(car: Car) -> None:
    rows = car.drive((0.0, 2.0), (60.0, 2.0))
    for corner in CORNERS:
        for name, sign in (("slip", -1), ("wheel_force_x", -1), ("wheel_force_z", 1), ("brake_torque", 1)):
            assert sign * column(rows, f"{name}_{corner}")[-1] > 0, name
        assert column(rows, f"pressure_demand_{corner}")[-1] > 0
    assert column(rows, "accel_x_road")[-1] == pytest.approx(-4.0, abs=0.1)
    assert column(rows, "decel_demand_total")[-1] == pytest.approx(4.0)


def test_forces_add_up_to_mass_times_deceleration_less_drag(car: Car) -> None:
    rows = car.drive((0.0, 2.0), (60.0, 3.0))
    total = sum(column(rows, f"wheel_force_x_{c}")[-50:].mean() for c in CORNERS)
    drag = car.p["drag_area"] * car.speed**2
    assert total == pytest.approx(-car.p["mass"] * 4.0 + drag, rel=0.03)


def test_nothing_promised_is_ever_nan(car: Car) -> None:
    rows = car.drive(*STOP, *STOP)
    assert np.isfinite(rows[1:, PROMISED]).all(), [
        OUTPUT_COLUMNS[k] for k in PROMISED if not np.isfinite(rows[1:, k]).all()
    ]


@pytest.mark.requirement("REQ-DEM-2")
def test_armed_or_shadow(params, feed) -> None:
    for armed in (0, 1):
        params[0]["transmit"] = armed
        rows = Car(params, feed).drive((0.0, 1.0), (40.0, 1.0))
        assert column(rows, "pressure_demand_valid")[-1] == armed


@pytest.mark.requirement("REQ-DEM-1")
def test_no_pedal_and_no_demand_is_failed_and_flagged_invalid(params, feed) -> None:
    params[0]["transmit"] = 1
    car = Car(params, feed)
    car.drive((0.0, 1.0), (60.0, 1.0))
    for name in ("pedal_position", "pedal_pressed", "decel_demand"):
        car.inputs[0]["verdict"][INPUT[name]] = 0
    row = car.cycle(60.0)[None]
    assert column(row, "mode")[0] == FAILED
    assert int(column(row, "active_faults")[0]) & REQUEST_LOST
    assert column(row, "pressure_demand_valid")[0] == 0
    assert [column(row, f"pressure_demand_{c}")[0] for c in CORNERS] == [0.0] * 4


@pytest.mark.parametrize("lost", ["decel_demand", "decel_demand_valid"])
@pytest.mark.parametrize("pedal", [True, False], ids=["pedal received", "no pedal on the bus"])
@pytest.mark.parametrize(("cycles", "without"), [(1, 0), (5, 0), (10, 0), (12, 2)])
def test_an_automated_demand_that_is_lost_is_kept_for_a_tenth_of_a_second(
    params, feed, cycles: int, without: int, pedal: bool, lost: str
) -> None:
    """Its frames go on, but say "not available"."""
    params[0]["transmit"] = 1
    car = Car(params, feed)
    if not pedal:
        for name in ("pedal_position", "pedal_pressed"):
            car.inputs[0]["verdict"][INPUT[name]] = 0
    car.overwrite = {"decel_demand": 4.0, "decel_demand_valid": 1.0}
    asked = car.drive((0.0, 1.0))[-1:]
    car.inputs[0]["verdict"][INPUT[lost]] = ALIVE
    during = car.drive((0.0, cycles * DT))
    car.inputs[0]["verdict"][INPUT[lost]] = USABLE
    after = car.drive((0.0, 0.02))
    kept = column(during, "decel_demand_total") == column(asked, "decel_demand_total")
    assert kept.tolist() == [True] * (cycles - without) + [False] * without
    assert column(after, "decel_demand_total").tolist() == [4.0, 4.0]
    failed = np.zeros(cycles, bool) if pedal else ~kept
    assert (column(during, "mode") == FAILED).tolist() == failed.tolist()
    assert (column(during, "pressure_demand_valid") == 0).tolist() == failed.tolist()


def test_wheel_speeds_judged_by_a_speed_that_was_wrong_are_believed_again(params, feed) -> None:
    """No wheel shows the speed while all are left out, and none was judged without it: for good."""
    params[0]["transmit"] = 1
    car = Car(params, feed)
    car.drive((0.0, 1.0))
    wheels = slice(INPUT["wheel_speed_fl"], INPUT["wheel_speed_fl"] + 4)
    car.state["witness"]["rejected"][0, wheels] = 1
    car.state["plausibility"]["fell"] = 1
    car.state["joint"]["started"] = 0
    speed = column(car.drive((0.0, 1.0)), "vehicle_speed")
    assert speed[-1] == pytest.approx(car.speed, rel=0.01)
    assert not car.state["witness"]["rejected"][0, wheels].any()


@pytest.mark.requirement("REQ-IN-2")
def test_a_lost_wheel_speed_degrades_and_braking_goes_on(params, feed) -> None:
    params[0]["transmit"] = 1
    car = Car(params, feed)
    before = car.drive((0.0, 1.0), (60.0, 2.0))[-1:]
    car.inputs[0]["verdict"][INPUT["wheel_speed_fl"]] = 0
    car.inputs[0]["new"][INPUT["wheel_speed_fl"]] = 0
    rows = car.drive((60.0, 0.5))
    assert column(rows, "mode")[-1] == DEGRADED
    assert column(rows, "pressure_demand_valid")[-1] == 1
    for corner in CORNERS:
        demand, was = (
            column(rows, f"pressure_demand_{corner}")[-1],
            column(before, f"pressure_demand_{corner}")[0],
        )
        assert demand == pytest.approx(was, rel=0.25)
    # What the other wheels and the car's deceleration still say moves it within its uncertainty only.
    held, sigma = column(rows, "mu_b_fl"), column(rows, "sigma_mu_b_fl")
    assert held.max() - held.min() < sigma[0]
    assert (sigma > 0).all()
    assert column(rows, "mode_fl")[-1] == FAULT


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", SEEN)
@pytest.mark.requirement("REQ-IN-3")
def test_a_value_that_cannot_be_is_survived_reported_and_forgotten(car: Car, name: str, value: float) -> None:
    """Freshness lets no such value through; here it comes nevertheless, for 50 ms of a braking."""
    car.drive((0.0, 2.0), (60.0, 1.5))
    car.overwrite = {name: value}
    during = car.drive((60.0, 0.05))
    car.overwrite = {}
    after = car.drive((60.0, 1.5))
    both = np.concatenate([during, after])
    broken = sorted({OUTPUT_COLUMNS[k] for k in PROMISED if not np.isfinite(both[:, k]).all()})
    if name == "pedal_position":  # nobody asks: what is asked for is not available
        broken = [b for b in broken if not b.startswith(("decel_demand_total", "pressure_uncompensated"))]
    if name == "accel_x":  # not measured then; what the ECU takes it for is accel_x_model
        broken = [b for b in broken if b != "accel_x_road"]
    assert set(broken) <= {name}
    for corner in CORNERS:
        demand = column(both, f"pressure_demand_{corner}")
        assert (demand >= 0).all()
        assert (demand <= 180).all()
        assert column(after, f"mu_b_{corner}").min() >= 0.5 * 0.45
        assert column(after, f"mu_b_{corner}").max() <= 1.5 * 0.45
    assert column(after, "vehicle_speed")[-1] == pytest.approx(car.speed, abs=1.5)
    assert [column(after, f"mode_{c}")[-1] for c in CORNERS] == [OBSERVING] * 4
    assert column(after, "mode")[-1] == ACTIVE
    if not math.isfinite(value) and name not in ("decel_demand", "pedal_position"):
        assert column(during, "active_faults").any(), "no fault bit"


@pytest.mark.parametrize("name", ["accel_x", "wheel_speed_fl", "calliper_pressure_rr", "yaw_rate"])
def test_a_signal_that_is_lost_for_a_tenth_of_a_second_leaves_no_trace(params, feed, name: str) -> None:
    """No value changes, the frames are just not there: alive, then not, then alive again."""
    car = Car(params, feed)
    car.drive((0.0, 2.0), (60.0, 1.5))
    place = INPUT[name]
    before = car.inputs[0]["verdict"][place]
    car.inputs[0]["verdict"][place] = 0
    lost = car.drive((60.0, 0.1))
    car.inputs[0]["verdict"][place] = before
    after = car.drive((60.0, 1.5))
    twin = Car(params, feed).drive((0.0, 2.0), (60.0, 3.1))  # nothing lost
    assert column(lost, "active_faults").all()
    assert [column(after, f"mode_{c}")[-1] for c in CORNERS] == [OBSERVING] * 4
    assert column(after, "k_f")[-1] == pytest.approx(column(twin, "k_f")[-1], abs=0.05)
    assert [column(after, f"mu_b_{c}")[-1] for c in CORNERS] == pytest.approx([0.40] * 4, rel=0.10)
    assert column(after, "vehicle_speed")[-1] == pytest.approx(car.speed, abs=0.5)


def test_friction_survives_release_and_a_new_life(params, feed) -> None:
    car = Car(params, feed, mu=0.38)
    rows = car.drive((0.0, 3.0), (60.0, 3.5), (0.0, 3.0))
    learned = car.state["learned"][0]["mu_b"].copy()
    assert learned == pytest.approx(np.full(4, 0.38), rel=0.06)
    assert column(rows, "mode_fl")[-1] == HOLDING
    assert column(rows, "mode")[-1] == READY
    again = Car(params, feed, mu=0.38)
    again.state = new_state(params, car.state["learned"])
    row = again.drive((0.0, 0.5), (60.0, 0.5))[-1:]
    # The first braking of the new life asks for the pressure of the friction learned; coasting says a little.
    front = (car.p["rear_axle"] + 4.0 / G * car.p["cog_height"]) / car.p["wheelbase"]
    torque = 0.5 * front * car.p["mass"] * 4.0 * car.p["wheel_radius"][0]
    bar = (torque / (2 * car.p["piston_area"][0] * learned[0] * car.p["effective_radius"][0])) / BAR + 0.5
    assert column(row, "pressure_uncompensated_fl")[0] == pytest.approx(bar, rel=1e-4)


@pytest.mark.parametrize("mu", [0.36, 0.54])
def test_compensation_asks_for_the_pressure_that_the_linings_need(params, feed, mu: float) -> None:
    car = Car(params, feed, mu=mu, reference=True)
    rows = car.drive((0.0, 5.0), (60.0, 4.0))
    needed = car.wheels()[1]
    for k, corner in enumerate(CORNERS):
        asked = column(rows, f"pressure_demand_{corner}")[-1]
        nominal = column(rows, f"pressure_uncompensated_{corner}")[-1]
        print(f"{corner}: asked {asked:.1f}, needed {needed[k]:.1f}, uncompensated {nominal:.1f} bar")
        assert abs(asked - needed[k]) < abs(nominal - needed[k])


def test_switched_off_compensation_leaves_the_base(params, feed) -> None:
    params[0]["compensation"] = OFF
    rows = Car(params, feed, mu=0.36).drive((0.0, 2.0), (60.0, 3.0))
    demand, uncompensated = (column(rows, f"pressure_{k}_fl")[-200:] for k in ("demand", "uncompensated"))
    assert demand == pytest.approx(uncompensated, abs=1e-6)


def test_the_base_changes_between_brakings_alone(params, feed) -> None:
    """A moment on the brakes moves it by less than what is known of it already."""
    car = Car(params, feed, mu=0.38)
    seen, learned = [], []
    for pedal, seconds in ((0.0, 3.0), (60.0, 3.5), (0.0, 1.0), (60.0, 0.6), (0.0, 1.0)):
        leg = []
        for _ in range(round(seconds / DT)):
            car.cycle(pedal)
            leg.append(car.state["control"][0]["base"].copy())
        seen.append(np.array(leg))
        learned.append(car.state["learned"][0]["mu_b"].copy())
    nominal, first = params[0]["mu_nominal"], learned[2]
    assert np.all(seen[1] == nominal)  # the whole first braking
    assert first == pytest.approx(np.full(4, 0.38), rel=0.06)
    base = first * car.state["control"][0]["start"]
    assert base == pytest.approx(first, rel=0.05)  # this car's friction is the same all along
    assert np.all(seen[2][-1] == base)
    assert np.all(seen[3] == base)
    sigma = car.state["learned"][0]["sigma_mu_b"]
    assert np.all(np.abs(seen[4][-1] - base) < 0.5 * sigma)
    assert np.all(sigma < 0.10 * base)


def test_no_demand_beyond_what_the_accumulator_holds_and_the_driver_is_told(car: Car) -> None:
    fine = car.drive((0.0, 1.0), (60.0, 2.0))
    car.overwrite = {"accumulator_pressure": 20.0} | {f"calliper_pressure_{c}": 20.0 for c in CORNERS}
    low = car.drive((60.0, 1.5))
    assert column(fine, "pressure_demand_fl").max() > 25.0
    faults = column(low, "active_faults").astype(int)
    confirmed = 45  # cycles
    for corner in CORNERS:
        assert column(low, f"pressure_demand_{corner}")[confirmed:].max() <= 20.0
    assert (faults[confirmed:] & ACCUMULATOR_LOW).all()
    assert not (faults[:confirmed] & BRAKE_FADE).any()
    assert (faults[confirmed + 35 :] & BRAKE_FADE).all()
    assert not (column(fine, "active_faults").astype(int) & (ACCUMULATOR_LOW | BRAKE_FADE)).any()
    car.overwrite = {"accumulator_pressure": 180.0}
    again = car.drive((60.0, 0.5))
    assert column(again, "pressure_demand_fl")[-1] > 20.0


def test_an_accumulator_that_reads_less_than_a_calliper_holds_limits_nothing(car: Car) -> None:
    fine = car.drive((0.0, 1.0), (60.0, 2.0))
    car.overwrite = {"accumulator_pressure": 11.0}
    lied = car.drive((60.0, 1.5))
    assert column(lied, "pressure_demand_fl").min() > 0.95 * column(fine, "pressure_demand_fl")[-1]
    reported = column(lied, "active_faults_2").astype(int) & (IMPLAUSIBLE["accumulator_pressure"] >> 32)
    assert reported[15:].all()
    assert not (column(lied, "active_faults").astype(int) & ACCUMULATOR_LOW).any()


def test_a_wheel_that_locks_is_let_go_and_nothing_is_learned_from_it(car: Car) -> None:
    car.drive((0.0, 2.0), (60.0, 3.0))
    known = car.state["estimate"][0]["mu"].copy()
    car.overwrite = {"wheel_speed_fl": 0.6 * car.speed / 0.36}
    car.drive((60.0, 0.02))
    car.overwrite = {"wheel_speed_fl": 0.3 * car.speed / 0.36}
    locked = car.drive((60.0, 0.3))
    faults = column(locked, "active_faults").astype(int)
    assert (faults[2:] & WHEEL_SLIPS).all()
    assert column(locked, "pressure_demand_fl")[-1] < 1.0
    assert column(locked, "pressure_demand_fr")[-1] > 25.0
    assert not (faults & (DEMAND_LIMITED | BRAKE_FADE)).any()
    assert [column(locked, f"mode_{c}")[-1] for c in CORNERS] == [HOLDING] * 4
    assert car.state["estimate"][0]["mu"] == pytest.approx(known, rel=0.02)


@pytest.mark.parametrize("missed", [1, 5])
def test_after_missed_periods_one_step_covers_the_time(params, feed, missed: int) -> None:
    car = Car(params, feed)
    car.drive((0.0, 2.0), (60.0, 1.0))
    car.inputs["dt_ns"] = (missed + 1) * 10_000_000
    car.speed -= missed * DT * car.decel
    car.cycle(60.0)
    car.inputs["dt_ns"] = 10_000_000
    rows = car.drive((60.0, 1.0))
    assert column(rows, "vehicle_speed")[-1] == pytest.approx(car.speed, abs=0.3)
    assert np.isfinite(rows[:, PROMISED]).all()


def _values(record: np.ndarray, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the real numbers of a record by the names of their fields."""
    for field in record.dtype.names or ():
        yield from _values(record[field], f"{name}.{field}")
    if record.dtype.kind == "f":
        yield name, record


def test_nothing_decays_for_ever(car: Car) -> None:
    """Numbers that are nearly zero and not normal take a processor a hundred times as long."""
    car.params["blending"] = 0.5
    car.overwrite = dict.fromkeys((f"motor_limit_{corner}" for corner in CORNERS), 500.0)
    car.drive((0.0, 1.0), (40.0, 2.0))
    car.overwrite = dict.fromkeys(car.overwrite, 0.0)
    car.drive((40.0, 0.5), (0.0, 40.0))
    least = np.finfo(np.float64).tiny
    small = {
        name for name, value in _values(car.state, "state") if ((value != 0) & (abs(value) < least)).any()
    }
    assert not small


@pytest.mark.requirement("REQ-LOOP-2")
def test_ten_thousand_cycles_allocate_nothing(car: Car) -> None:
    memsys_enable_stats()
    car.drive((0.0, 0.5), (60.0, 0.5))
    before = rtsys.get_allocation_stats()
    for _ in range(10_000):
        step(car.params, car.state, car.inputs, car.outputs)
    after = rtsys.get_allocation_stats()
    # Each of the four arrays handed over from Python is wrapped once and freed; inside nothing is allocated.
    assert after.alloc - before.alloc <= 4 * 10_000
    assert (after.alloc - after.free, after.mi_alloc - after.mi_free) == (
        before.alloc - before.free,
        before.mi_alloc - before.mi_free,
    )


def test_heat_put_in_since_friction_was_observed_widens_it(params, feed) -> None:
    """200 K are 8 % (assumption of `disc_temperature`); never a change of friction itself."""
    greatest = []
    for change in (0.0, 200.0):
        car = Car(params, feed)
        car.drive((0.0, 1.0), (60.0, 2.0), (0.0, 1.0))
        car.state["discs"][0]["observed_at"] -= change
        before = car.state["estimate"][0]["mu"].copy()
        rows = car.drive((60.0, 0.25))
        widest = int(column(rows, "sigma_mu_b_fl").argmax())
        greatest.append(column(rows, "sigma_mu_b_fl")[widest] / column(rows, "mu_b_fl")[widest])
        assert column(rows, "mu_b_fl")[widest] == pytest.approx(before[0], rel=0.02)
    assert greatest[1] ** 2 - greatest[0] ** 2 == pytest.approx(0.08**2, rel=0.2)


def test_a_recording_keeps_all_of_a_first_state_but_the_estimate_which_follows(params) -> None:
    learned = new_state(params)["learned"].copy()
    learned["mu_b"], learned["sigma_mu_b"], learned["observed_s"] = 0.4, 0.02, 30.0
    state, other = new_state(params, learned), new_state(params)
    assert state["estimate"]["mu"] == pytest.approx(0.4)
    resume(other, initial_part(state))
    for name in STATE.names or ():
        assert other[name].tobytes() == state[name].tobytes(), name
