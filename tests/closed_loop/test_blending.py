"""Motors and linings in closed loop: their sum follows the demand while torque changes hands, and without
motors soon again; cars of three seeds; the ECU knows the true friction."""

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import shipped
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.control import blending
from brakelab.studies.control.blending import (
    LOSS,
    blended,
    changing,
    counted,
    demanded,
    loss,
    stop,
    torques,
    wrong_friction,
)
from ecu.contract.faults import MOTOR_SHORT
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SEEDS = (0, 1, 2)
GONE = Fault(kind="motor_lost", t=LOSS)
HIDDEN = Fault(kind="stuck", t=LOSS, signal=["motor_limit"])
MUTE = Fault(kind="lost", t=LOSS, message=["MotorFront", "MotorRear"])


def drive(scenario: Scenario, share: float, seed: int = 0, armed: bool = True) -> Drive:
    """Brakes are as described: what is left of the error is that of blending."""
    return run(new_loop(with_draw(scenario, "nominal"), blended(share), seed, armed), ideal=True)


def faulty(*faults: Fault) -> Scenario:
    return shipped("hand-over").model_copy(update={"fault": list(faults)})


@pytest.mark.parametrize(
    ("scenario", "share", "motors"),
    [
        (stop(4.0), 0.2, (19.0, 21.0)),
        (stop(4.0), 0.4, (39.0, 41.0)),
        (stop(4.0), 0.8, (78.0, 80.0)),
        (stop(4.0), 1.0, (95.0, 98.0)),
        (stop(8.0), 1.0, (60.0, 68.0)),
        (shipped("charge-limit"), 0.8, (56.0, 60.0)),
    ],
    ids=["0.2", "0.4", "0.8", "series", "series, 8 m/s²", "battery takes less"],
)
def test_the_sum_stays_within_2_percent_while_torque_changes_hands(scenario, share, motors) -> None:
    for seed in SEEDS:
        found = changing(drive(scenario, share, seed), blended(share))
        print(found)
        assert max(found.below, found.above) < 2.0
        assert motors[0] < found.motors < motors[1]


def test_a_limit_that_falls_without_notice_is_felt_for_50_ms_at_most() -> None:
    """In series phasing at the limit nothing can be planned before it falls."""
    for seed in SEEDS:
        found = changing(drive(shipped("charge-limit"), 1.0, seed), blended(1.0))
        assert found.outside_ms <= 50.0
        assert found.below < 5.0


@pytest.mark.parametrize(
    "scenario",
    [shipped("motor-loss"), faulty(GONE, HIDDEN), faulty(GONE, MUTE)],
    ids=["limit 0 is sent", "limit sent as before", "frames stop"],
)
@pytest.mark.parametrize("share", [0.2, 0.8, 1.0])
def test_linings_make_up_for_lost_motors_within_250_ms(scenario: Scenario, share: float) -> None:
    for seed in SEEDS:
        found = loss(drive(scenario, share, seed), blended(share))
        print(found)
        assert found.within_ms <= 250.0
        assert found.missing < 0.1  # never less than what the linings gave before
        assert found.above < 2.5


@pytest.mark.parametrize(
    ("scenario", "armed", "after"),
    [
        (faulty(GONE, HIDDEN), True, 0.06),
        (faulty(GONE, HIDDEN), False, None),  # a shadow asks nobody
        (faulty(GONE), True, None),  # a motor that says so is not short
        (faulty(MUTE), True, None),
        (shipped("hand-over"), True, None),
        (shipped("charge-limit"), True, None),
    ],
    ids=["limit sent as before", "shadow", "limit 0 is sent", "frames stop", "sound", "battery takes less"],
)
def test_a_motor_that_gives_less_than_its_limit_promises_is_reported(scenario, armed, after) -> None:
    for share in (0.2, 0.8, 1.0):
        result = drive(scenario, share, armed=armed)
        reported = result.t[(result.outputs["active_faults"].astype(int) & MOTOR_SHORT) != 0]
        assert bool(len(reported)) == (after is not None), share
        if after is not None:
            print(f"f = {share}: after {1e3 * (reported[0] - LOSS):.0f} ms")
            assert LOSS < reported[0] < LOSS + after
            assert reported[-1] > result.t[-1] - 0.2  # until the brakes are released


@pytest.mark.parametrize("corners", [CORNERS[:1], CORNERS], ids=["one", "all"])
def test_pressures_that_read_too_much_take_nothing_from_the_motors(corners: tuple[str, ...]) -> None:
    """A lining that gives more than asked would have its motor give as much less."""
    signals = [f"calliper_pressure_{corner}" for corner in corners]
    lie = Fault.model_validate({"kind": "set", "t": LOSS, "signal": signals, "amount": 100.0})
    found = changing(drive(faulty(lie), 0.4), blended(0.4))
    print(found)
    assert found.below < 2.0
    assert found.above < 4.0


def test_motors_that_only_fall_silent_hand_over_smoothly() -> None:
    for seed in SEEDS:
        found = changing(drive(faulty(MUTE), 0.8, seed), blended(0.8))
        assert found.below < 2.0
        assert found.above < 4.0
        assert found.outside_ms <= 50.0


def test_a_motor_lost_on_one_wheel_is_made_up_for_there() -> None:
    scenario = faulty(Fault(kind="motor_lost", t=LOSS, corner=["fl"]))
    result = drive(scenario, 0.8)
    after = (result.t > LOSS + 0.25) & counted(result)
    lining, motor = (result.truth[f"{stem}_torque_fl"][after] for stem in ("brake", "motor"))
    assert np.all(motor < 0.02 * lining)
    assert np.mean(result.truth["motor_torque_fr"][after]) > 500.0
    total = np.sum(torques(result), axis=0)[after] / demanded(result, blended(0.8))[after]
    assert np.max(np.abs(total - 1.0)) < 0.02


def test_the_sum_follows_when_the_driver_lets_go() -> None:
    base = shipped("hand-over")
    brake = Phase(kind="brake", decel=4.0, seconds=1.0)
    again = base.model_copy(update={"phase": [brake, Phase(kind="coast", seconds=1.0)] * 2})
    result = drive(again, 0.6)
    linings, motors = torques(result)
    error = linings + motors - demanded(result, blended(0.6))
    # The linings release within some 60 ms, and motors do not drive against them.
    assert np.max(np.abs(error)) < 0.10 * np.max(demanded(result, blended(0.6)))
    assert np.all(motors[result.t > 0.1] >= -0.5)
    assert abs(linings[-1] + motors[-1]) < 20.0


def test_the_motors_do_not_chatter() -> None:
    """1.8 bar of noise is 50 N m of a front lining."""
    result = drive(shipped("hand-over"), 0.4)
    steady = counted(result) & (result.truth["vehicle_speed"] > 5.0)
    for corner in CORNERS:
        change = np.diff(result.outputs[f"motor_demand_{corner}"][steady])
        assert np.std(change) < 2.0


def test_on_ice_the_motors_let_go_and_no_wheel_locks() -> None:
    """In series phasing no lining brakes, so the slip guard has nothing but the motors to act on."""
    result = drive(shipped("low-grip").model_copy(update={"blending": True}), 1.0)
    moving = result.truth["vehicle_speed"] > 3.0
    for corner in CORNERS:
        slip = result.truth[f"slip_{corner}"]
        assert np.min(slip[moving]) > -0.9
        assert np.max(result.outputs[f"motor_demand_{corner}"][moving & (slip < -0.2)], initial=0.0) == 0.0


@pytest.mark.parametrize(
    ("share", "armed", "valid", "known"),
    [(0.4, True, 1.0, True), (0.4, False, 0.0, True), (0.0, True, 0.0, False)],
    ids=["armed", "shadow", "off"],
)
def test_motor_demands_are_valid_where_they_count(share, armed, valid, known) -> None:
    result = drive(shipped("hand-over"), share, armed=armed)
    assert np.all(result.outputs["motor_demand_valid"][200:] == valid)
    assert np.all(np.isfinite(result.outputs["motor_demand_fl"]) == known)
    motors = torques(result)[1][counted(result)]
    assert (np.max(motors) > 500.0) == bool(valid)


@pytest.mark.parametrize(
    ("ratio", "left"),
    [
        pytest.param(1.15, 3.0, id="smoother than configured"),
        # Less pressure is given only as far as the friction is surely higher: that keeps 3 % of the error.
        pytest.param(0.85, 3.5, id="rougher"),
    ],
)
@pytest.mark.parametrize("share", [0.0, 0.4, 0.8])
def test_compensation_takes_the_error_of_wrong_friction_away(
    monkeypatch: pytest.MonkeyPatch, share: float, ratio: float, left: float
) -> None:
    """Figure 5.8; without compensation what the linings have is wrong by 15 %, and by the mass's 3 %."""
    monkeypatch.setattr(blending, "shipped", lambda name: with_draw(shipped(name), "nominal"))
    plain = wrong_friction(share, ratio, False, 0)
    assert plain == pytest.approx(100.0 * (1.0 - share) * abs(1.0 / ratio - 1.0), abs=3.5)
    assert wrong_friction(share, ratio, True, 0) < left


def test_the_shipped_configuration_blends_as_the_thesis_does() -> None:
    config = load_config(resource("config/suv-blended.toml"))
    assert (config.blending.front, config.blending.rear) == (0.7, 0.7)
    assert config.vehicle == load_config(resource("config/suv.toml")).vehicle
