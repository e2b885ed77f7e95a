"""The slip guard: which wheel is capped, when, at which pressure, and how it is let go."""

import math

import numpy as np
import pytest

from ecu.algorithm.control.rear_guard import ABOVE_LOW
from ecu.algorithm.control.slip_guard import (
    AHEAD,
    BACK_S,
    RANGE,
    SLIP_GUARD_STATE,
    STILL,
    guard_slip,
)
from ecu.algorithm.estimate import ESTIMATE
from ecu.contract.signals import INPUT

BAR, DT = 1e5, 0.01
SENT = np.array([60.0, 60.0, 40.0, 40.0]) * BAR


def new_guard() -> np.void:
    state = np.zeros(1, SLIP_GUARD_STATE)[0]
    state["rolled"] = math.nan
    return state


class Wheels:
    """A car that keeps its speed while the front-left wheel does as given.

    `turns`: the sign that its sensors give a wheel speed."""

    def __init__(self, params, feed, speed: float = 20.0, turns: float = 1.0, **flags: float) -> None:
        self.params, self.feed, self.flags, self.turns = params[0], feed, flags, turns
        self.state, self.estimate = new_guard(), np.zeros(1, ESTIMATE)[0]
        self.estimate["load"] = self.params["static_load"]
        self.inputs, self.speed = feed(), speed
        self.sent, self.wanted, self.motor = SENT.copy(), SENT.copy(), np.zeros(4)
        self.state["pressed"] = SENT

    def guard(self, speed: float, dt: float = DT) -> None:
        """Run the kernel on the inputs as they are; the callipers hold what was sent."""
        known = self.params, self.state, self.inputs[0], self.estimate, speed
        guard_slip(*known, self.sent, self.sent / BAR, self.motor, self.wanted, self.wanted, dt)

    def cycle(self, slip: float) -> float:
        """Run a cycle; return the front-left wheel's cap [bar], infinite if it has none."""
        omega = self.turns * abs(self.speed) / self.params["wheel_radius"]
        omega[0] *= 1.0 + slip
        self.feed(self.inputs, wheel_speed=omega, **self.flags)
        self.guard(self.speed)
        assert not self.state["capped"][1:].any()
        assert self.state["acting"] == self.state["capped"][0]
        if not self.state["capped"][0]:
            return math.inf
        self.sent[0] = min(self.wanted[0], self.state["cap"][0])
        return float(self.state["cap"][0] / BAR)

    def run_into(self, slip: float, seconds: float = 0.1) -> list[float]:
        """Let the wheel fall behind at a constant rate from rolling to `slip`."""
        n = round(seconds / DT)
        return [self.cycle(0.0) for _ in range(5)] + [self.cycle(slip * (k + 1) / n) for k in range(n)]


@pytest.fixture
def wheels(params, feed) -> Wheels:
    return Wheels(params, feed)


@pytest.mark.parametrize("growth", [12.0, 25.0, 60.0, 100.0])
def test_a_wheel_that_falls_behind_is_capped_from_a_tenth_of_slip_on(wheels: Wheels, growth) -> None:
    """The low-pass and the median take 30 ms."""
    slips = [-growth * k * DT / 20.0 for k in range(60)]
    caps = [wheels.cycle(slip) for slip in slips]
    first = next(k for k, cap in enumerate(caps) if math.isfinite(cap))
    assert 0.10 < -slips[first] <= 0.10 + growth * 3 * DT / 20.0
    assert caps[first] < 60.0


def test_a_wheel_that_stands_is_cut_down_to_the_push_out_pressure_and_no_further(wheels: Wheels) -> None:
    caps = wheels.run_into(-1.0)
    assert caps[-1] == pytest.approx(0.5)
    assert [wheels.cycle(-1.0) for _ in range(20)] == pytest.approx([0.5] * 20)


def test_cut_to_what_the_road_carries_less_what_brings_the_wheel_back(wheels: Wheels) -> None:
    """What a wheel slips more than it may it loses within 0.15 s: by torque over inertia."""
    wheels.run_into(-0.25, 0.25)  # at 20 m/s^2
    p = wheels.params
    gain = 2.0 * p["piston_area"][0] * p["effective_radius"][0] * p["mu_nominal"][0]
    bar = p["wheel_inertia"][0] / (p["wheel_radius"][0] * gain) / BAR  # of 1 m/s^2
    cap = wheels.cycle(-0.26)
    beyond = (0.26 - RANGE) * 20.0 + AHEAD * wheels.state["growth"][0]
    carried = wheels.state["pressed"][0] / BAR - bar * wheels.state["growth"][0]
    assert cap == pytest.approx(STILL * carried - bar * beyond / BACK_S, rel=0.02)


@pytest.mark.parametrize(("slip", "returned"), [(-0.2, True), (-0.45, True), (-0.55, False)])
def test_a_slip_that_stays_gets_its_pressure_back_unless_the_wheel_nearly_stands(
    wheels, slip, returned
) -> None:
    wheels.run_into(slip, 0.05)
    caps = [wheels.cycle(slip) for _ in range(40 if returned else 25)]
    assert math.isinf(caps[-1]) == returned
    assert returned or caps[-1] < 10.0


def test_a_sensor_that_is_scaled_at_once_costs_a_tenth_of_a_second(wheels: Wheels) -> None:
    caps = [wheels.cycle(0.0) for _ in range(5)] + [wheels.cycle(-0.2) for _ in range(40)]
    below = [cap for cap in caps if cap < 0.9 * 60.0]
    assert min(caps) > 0.8 * 60.0
    assert len(below) * DT <= 0.15


def test_given_back_to_what_the_road_carried_then_slowly_then_ever_faster(wheels: Wheels) -> None:
    """A wheel that comes back at 27 m/s^2, as a road that carries 35 bar would have it with 10 bar on it."""
    wheels.run_into(-0.4)
    wheels.wanted[:] = 150.0 * BAR
    cut = [wheels.cycle(slip) for slip in np.linspace(-0.4, -0.02, 28)]
    caps = [wheels.cycle(-0.02) for _ in range(150)]
    given = [cap for cap in caps if math.isfinite(cap)]
    print(f"cut to {min(cut):.1f}, given {given[0]:.1f} to {max(given):.1f} bar in {len(given)} cycles")
    rises = np.diff(given)
    assert (rises > 0.0).all()
    assert rises[0] < 0.01 * given[0]
    assert rises[-1] > 5.0 * rises[0]
    assert math.isinf(caps[-1])  # let go where the demand is reached


@pytest.mark.parametrize(("left", "right"), [(2, 3), (3, 2)])
def test_a_rear_wheel_brakes_by_what_the_road_carries_at_the_other_one(params, feed, left, right) -> None:
    state, estimate, inputs = new_guard(), np.zeros(1, ESTIMATE)[0], feed()
    estimate["load"], state["pressed"] = params[0]["static_load"], SENT
    sent, beside = SENT.copy(), []
    for slip in [*np.linspace(0.0, 0.5, 12), *np.linspace(0.5, 0.02, 20), *[0.02] * 5]:
        omega = 20.0 / params[0]["wheel_radius"]
        omega[left] *= 1.0 - slip
        feed(inputs, wheel_speed=omega)
        pressures = sent, sent / BAR, np.zeros(4), SENT, SENT
        guard_slip(params[0], state, inputs[0], estimate, 20.0, *pressures, DT)
        sent = np.where(state["capped"], np.minimum(state["cap"], SENT), SENT)
        if state["capped"][left] and not state["slides"][left]:
            beside.append(sent[right] / state["cap"][left])
    assert state["capped"][:2].tolist() == [0, 0]
    assert 0.8 < state["cap"][right] / state["cap"][left] <= ABOVE_LOW
    assert ABOVE_LOW < max(beside) < ABOVE_LOW / 0.9, "by what the road carries, then as the other returns"
    assert beside[1:5] == pytest.approx([ABOVE_LOW] * 4)


@pytest.mark.parametrize(
    ("case", "slip", "seconds"),
    [
        ("a braking at the limit of a dry road", -0.08, 0.3),
        ("a speed that is wrong by a tenth and drifts", -0.15, 3.0),
        ("a driven wheel", 0.4, 0.1),
    ],
)
def test_what_caps_nothing(wheels: Wheels, case: str, slip: float, seconds: float) -> None:
    assert all(math.isinf(cap) for cap in wheels.run_into(slip, seconds)), case


@pytest.mark.parametrize(
    ("case", "speed"),
    [("walking pace", 2.5), ("walking pace backwards", -2.5), ("speed unknown", math.nan)],
)
def test_where_nothing_is_capped(params, feed, case, speed) -> None:
    assert all(math.isinf(cap) for cap in Wheels(params, feed, speed).run_into(-0.9)), case


@pytest.mark.parametrize("turns", [1.0, -1.0], ids=["wheel speeds without a sign", "with their sign"])
def test_backwards_a_wheel_is_capped_as_forwards(params, feed, turns: float) -> None:
    forwards = Wheels(params, feed, 8.0).run_into(-0.9)
    backwards = Wheels(params, feed, -8.0, turns, reverse=1.0).run_into(-0.9)
    assert any(math.isfinite(cap) for cap in forwards)
    assert backwards == pytest.approx(forwards)


@pytest.mark.parametrize("flag", ["abs_active", "esp_active"])
def test_beside_an_abs_the_demand_is_held_and_not_cut(params, feed, flag: str) -> None:
    wheels = Wheels(params, feed, **{flag: 1.0})
    caps = wheels.run_into(-0.95) + [wheels.cycle(-0.95) for _ in range(20)]
    assert [cap for cap in caps if math.isfinite(cap)] == pytest.approx([60.0] * 29)
    wheels.wanted[0] = 100 * BAR
    assert wheels.cycle(-1.0) == pytest.approx(60.0)


def test_a_lost_wheel_speed_caps_nothing(wheels: Wheels) -> None:
    place = INPUT["wheel_speed_fl"]
    wheels.run_into(-0.05)
    wheels.inputs[0]["new"][place] = wheels.inputs[0]["verdict"][place] = 0
    assert all(math.isinf(wheels.cycle(-1.0)) for _ in range(20))


def test_a_frame_that_is_missing_does_not_make_a_wheel_fall_faster(wheels: Wheels) -> None:
    """Slip grows by 9 m/s^2, below what is taken for a wheel that locks; every second sample is missing."""
    place, found = INPUT["wheel_speed_fl"], []
    for k in range(60):
        wheels.inputs[0]["new"][place] = k % 2
        found.append(wheels.cycle(-9.0 * k * DT / 20.0))
    assert all(math.isinf(cap) for cap in found)


def test_without_a_demand_the_cap_is_gone(wheels: Wheels) -> None:
    wheels.run_into(-1.0)
    wheels.wanted[:] = 0.0
    assert math.isinf(wheels.cycle(-1.0))


def test_a_value_that_is_not_finite_leaves_no_trace(wheels: Wheels) -> None:
    wheels.run_into(-0.05)
    wheels.cycle(math.nan)
    wheels.cycle(math.inf)
    caps = [wheels.cycle(0.0) for _ in range(20)] + wheels.run_into(-0.5)
    assert math.isinf(caps[0])
    assert math.isfinite(caps[-1])
    assert np.isfinite(wheels.state["growth"]).all()


@pytest.mark.parametrize(("growth", "capped"), [(9.5, False), (10.5, True)])
def test_a_wheel_falls_behind_from_ten_metres_per_second_squared_on(wheels, growth, capped) -> None:
    caps = [wheels.cycle(-growth * k * DT / 20.0) for k in range(60)]
    assert any(map(math.isfinite, caps)) == capped


def test_an_old_sample_is_not_taken_twice(wheels: Wheels) -> None:
    """A wheel at 30 % of slip whose next frame is late: growth is known by the frames alone."""
    place = INPUT["wheel_speed_fl"]
    wheels.run_into(-0.05)
    before = wheels.state["growth"][0], wheels.state["lag"][0]
    omega = wheels.inputs[0]["value"].copy()
    wheels.inputs[0]["new"][place] = 0
    for _ in range(3):
        wheels.guard(30.0)
    assert (wheels.inputs[0]["value"] == omega).all()
    assert (wheels.state["growth"][0], wheels.state["lag"][0]) == before
    assert wheels.state["age"][0] == pytest.approx(3 * DT)


def test_of_a_lost_wheel_speed_nothing_is_kept(wheels: Wheels) -> None:
    place = INPUT["wheel_speed_fl"]
    wheels.run_into(-0.4)
    wheels.inputs[0]["new"][place] = wheels.inputs[0]["verdict"][place] = 0
    wheels.guard(20.0)
    for name in ("lag", "growth", "noise", "fall"):
        assert wheels.state[name][0] == 0.0


def test_growth_that_is_not_finite_is_forgotten_while_the_sensor_lives(wheels: Wheels) -> None:
    wheels.run_into(-0.05)
    wheels.state["growth"][0] = math.nan
    wheels.cycle(-0.05)
    assert wheels.state["growth"][0] == wheels.state["lag"][0] == 0.0


def test_a_cap_is_set_once_and_not_raised_by_the_demand(wheels: Wheels) -> None:
    """While the wheel locks the demand that was sent is the cap itself, whatever the driver adds."""
    caps = [cap for cap in wheels.run_into(-0.9) if math.isfinite(cap)]
    wheels.sent[0] = wheels.wanted[0] = 150.0 * BAR
    assert wheels.cycle(-0.95) <= caps[-1]


@pytest.mark.parametrize(("speed", "capped"), [(2.9, False), (3.2, True), (4.0, True), (-4.0, True)])
def test_wheels_are_watched_from_three_metres_per_second_on(params, feed, speed, capped) -> None:
    caps = Wheels(params, feed, speed).run_into(-0.95)
    assert any(map(math.isfinite, caps)) == capped


def test_a_car_that_becomes_too_slow_gives_the_pressure_back_with_150_bar_per_second(wheels: Wheels) -> None:
    cut = wheels.run_into(-1.0)[-1]
    wheels.speed = 2.0
    caps = [wheels.cycle(-1.0) for _ in range(10)]
    assert caps == pytest.approx([cut + 1.5 * (k + 1) for k in range(10)], abs=0.1)


def test_growth_is_low_passed_with_20_ms(wheels: Wheels) -> None:
    for _ in range(20):
        wheels.cycle(0.0)
    wheels.cycle(-0.05)  # 1 m/s in 10 ms
    assert wheels.state["growth"][0] == 0.0  # once: that may be a jump of the signal
    wheels.cycle(-0.10)
    assert wheels.state["growth"][0] == pytest.approx(100.0 * (1.0 - math.exp(-0.5)))


@pytest.mark.parametrize("jump", [-0.2, -0.5, 0.2])
def test_a_wheel_speed_that_jumps_once_caps_nothing(wheels: Wheels, jump) -> None:
    wheels.cycle(0.0)
    for _ in range(50):
        wheels.cycle(jump)
    assert not wheels.state["capped"].any()


def test_an_abs_that_is_half_said_to_work_does_not(params, feed) -> None:
    caps = Wheels(params, feed, abs_active=0.5).run_into(-0.95)
    assert min(caps) < 56.0


def test_within_the_range_a_fast_growing_slip_caps_nothing(wheels: Wheels) -> None:
    """The driver asks for much more than was sent: it would be held where it is."""
    wheels.wanted[:] = 150.0 * BAR
    assert all(math.isinf(cap) for cap in wheels.run_into(-0.09, 0.02))


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize("lost", [False, True])
def test_each_wheel_is_watched_by_its_own_sensor(params, feed, corner: int, lost: bool) -> None:
    state, estimate = new_guard(), np.zeros(1, ESTIMATE)[0]
    place, inputs = INPUT["wheel_speed_fl"] + corner, feed()
    for k in range(12):
        omega = 20.0 / params[0]["wheel_radius"]
        omega[corner] *= 1.0 - 0.07 * k
        feed(inputs, wheel_speed=omega)
        if lost:
            inputs[0]["new"][place] = inputs[0]["verdict"][place] = 0
        guard_slip(params[0], state, inputs[0], estimate, 20.0, SENT, SENT / BAR, np.zeros(4), SENT, SENT, DT)
    assert state["capped"].tolist() == [int(i == corner and not lost) for i in range(4)]


@pytest.mark.parametrize("corner", range(4))
def test_a_late_sample_is_waited_for_and_a_lost_one_forgotten(params, feed, corner: int) -> None:
    state, estimate = new_guard(), np.zeros(1, ESTIMATE)[0]
    place, inputs = INPUT["wheel_speed_fl"] + corner, feed()
    lags = []
    for k in range(8):
        omega = 20.0 / params[0]["wheel_radius"]
        omega[corner] *= 1.0 - 0.07 * k
        feed(inputs, wheel_speed=omega)
        inputs[0]["new"][place] = k < 5
        inputs[0]["verdict"][place] *= k < 7
        guard_slip(params[0], state, inputs[0], estimate, 20.0, SENT, SENT / BAR, np.zeros(4), SENT, SENT, DT)
        lags.append(float(state["lag"][corner]))
    assert lags == pytest.approx([20.0 * 0.07 * k for k in (0, 1, 2, 3, 4, 4, 4)] + [0.0])
    assert state["growth"][corner] == 0.0


def test_no_time_between_two_cycles_changes_nothing(wheels: Wheels) -> None:
    wheels.run_into(-0.08)
    before = wheels.state.copy()
    wheels.guard(20.0, 0.0)
    assert {name for name in SLIP_GUARD_STATE.names if (wheels.state[name] != before[name]).any()} == set()


@pytest.mark.parametrize(("braking", "capped"), [(0.0, True), (1.5, True), (4.0, False)])
def test_a_wheel_that_falls_as_the_car_does_falls_behind_nothing(wheels, braking, capped) -> None:
    """A vehicle speed that stands still: the wheels fall at 12 m/s^2, of which the car brakes some."""
    wheels.estimate["accel_x"] = -braking
    caps = [wheels.cycle(-12.0 * k * DT / 20.0) for k in range(60)]
    assert any(map(math.isfinite, caps)) == capped


@pytest.mark.parametrize(("noise", "capped"), [(0.0, True), (0.05, True), (1.0, False)])
def test_noise_of_a_wheel_speed_is_no_slip(wheels, noise: float, capped: bool) -> None:
    """A lag of 3 m/s that grows by 15 m/s^2, and noise [m/s]: of 1 m/s its differences are 140 m/s^2."""
    random = np.random.default_rng(0)
    for _ in range(100):
        wheels.cycle(noise * random.standard_normal() / 20.0)
    caps = [wheels.cycle((-15.0 * k * DT + noise * random.standard_normal()) / 20.0) for k in range(30)]
    assert any(map(math.isfinite, caps)) == capped


def test_a_wheel_without_torque_that_does_not_spin_up_has_a_sensor_that_lies(wheels: Wheels) -> None:
    """It falls to a value and stays there: held for the cut, 0.3 s and the return, then never again."""
    caps = wheels.run_into(-0.6) + [wheels.cycle(-0.6) for _ in range(150)]
    bottom = next(k for k, cap in enumerate(caps) if cap == pytest.approx(0.5))
    returned = next(k for k in range(bottom, len(caps)) if caps[k] > 1.0)
    assert (returned - bottom) * DT == pytest.approx(0.3, abs=3 * DT)
    assert all(math.isinf(cap) for cap in caps[-50:])
    assert wheels.state["denied"].tolist() == [1, 0, 0, 0]
    wheels.cycle(0.0)
    assert not wheels.state["denied"].any()
    assert any(map(math.isfinite, wheels.run_into(-0.5)))


def test_a_wheel_that_spins_up_on_ice_is_held_until_it_has(wheels: Wheels) -> None:
    """At an adhesion of 0.1 a wheel without torque gains some 15 m/s^2."""
    wheels.run_into(-0.9)
    caps = [wheels.cycle(-0.9) for _ in range(15)]
    caps += [wheels.cycle(-0.9 + 15.0 * k * DT / 20.0) for k in range(100)]
    assert not wheels.state["denied"].any()
    assert all(math.isfinite(cap) for cap in caps)


def give_back(wheels: Wheels, cap: float, grip: float) -> None:
    """Let the front-left wheel be one whose pressure [bar] is being given back."""
    state = wheels.state
    wheels.sent[0] = state["pressed"][0] = cap * BAR
    state["capped"][0], state["cap"][0], state["grip"][0] = 1, cap * BAR, grip * BAR


def test_noise_alone_does_not_cut_again_what_is_being_given_back(wheels: Wheels) -> None:
    """At 10 m/s a wheel with 0.065 m/s of noise in its speed has 5 bar: growth passes 5 m/s^2 each second."""
    wheels.speed = 10.0
    random = np.random.default_rng(0)
    for _ in range(200):
        wheels.cycle(0.0065 * random.standard_normal())
    give_back(wheels, 5.0, 5.0)
    caps = [wheels.cycle(0.0065 * random.standard_normal()) for _ in range(100)]
    assert np.all(np.diff([cap for cap in caps if math.isfinite(cap)]) > 0.0)
    assert math.isinf(caps[-1])


def test_a_wheel_that_rolls_and_gains_speed_shows_nothing_of_the_road(wheels: Wheels) -> None:
    """Else every gain would be taken for its grip, and the pressure never climb faster than that."""
    give_back(wheels, 5.0, 4.0)
    for slip in (-0.01, -0.005, 0.0, 0.005, 0.01):
        wheels.cycle(slip)
    assert wheels.state["growth"][0] < -5.0
    assert wheels.state["grip"][0] == pytest.approx(4.0 * BAR)


@pytest.mark.parametrize(("flags", "least"), [({}, 0.5), ({"esp_active": 1.0}, 1.0)], ids=["alone", "ESP"])
def test_what_the_road_carries_goes_with_the_load(params, feed, flags, least) -> None:
    """Beside another controller the cap never falls."""
    wheels = Wheels(params, feed, **flags)
    wheels.cycle(0.0)
    give_back(wheels, 6.0, 8.0)
    before = wheels.state["cap"][0]
    load = wheels.estimate["load"][0]
    for share in np.linspace(1.0, 0.5, 20):
        wheels.estimate["load"][0] = share * load
        wheels.cycle(0.0)
    assert wheels.state["grip"][0] == pytest.approx(8.0 * BAR * least)
    assert wheels.state["cap"][0] / before == pytest.approx(least, abs=0.1)
    for share in np.linspace(0.5, 1.0, 20):
        wheels.estimate["load"][0] = share * load
        wheels.cycle(0.0)
    assert wheels.state["grip"][0] == pytest.approx(8.0 * BAR * least / 0.5)


@pytest.mark.parametrize(("left", "right"), [(2, 3), (3, 2)])
def test_a_rear_wheel_that_is_held_for_the_other_one_returns_with_it(params, feed, left, right) -> None:
    state, estimate, inputs = new_guard(), np.zeros(1, ESTIMATE)[0], feed()
    estimate["load"], state["pressed"] = params[0]["static_load"], SENT
    feed(inputs, wheel_speed=20.0 / params[0]["wheel_radius"])
    state["capped"][left] = 1
    followed = []
    for grip in (10.0, 5.0, 20.0):
        state["cap"][left] = state["grip"][left] = grip * BAR
        guard_slip(params[0], state, inputs[0], estimate, 20.0, SENT, SENT / BAR, np.zeros(4), SENT, SENT, DT)
        followed.append(state["cap"][right] / state["cap"][left])
    assert followed == pytest.approx([ABOVE_LOW] * 3)
    assert state["follows"].tolist() == [int(i == right) for i in range(4)]
    state["capped"][left] = 0
    before = state["cap"][right]
    guard_slip(params[0], state, inputs[0], estimate, 20.0, SENT, SENT / BAR, np.zeros(4), SENT, SENT, DT)
    assert state["cap"][right] - before == pytest.approx(1.5 * BAR)
