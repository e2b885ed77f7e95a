"""One ingredient taken away and nothing else: what is withheld, forgotten or worthless, and what stays."""

import numpy as np
import pytest

from brakelab.bench.ablation import (
    ABLATIONS,
    CASES,
    Ablation,
    Sample,
    ablation_table,
    drive_without,
    forget,
    without,
)
from brakelab.bench.observers import counted
from brakelab.bench.observers_cases import configured, shipped
from brakelab.bench.stops import AXLES, estimate_errors
from ecu.config import new_params
from ecu.estimation.joint.layout import MASS, MU, RATIO
from ecu.estimation.joint.prior import PRIOR
from ecu.records import LEARNED, RecordArray, new_record
from ecu.step import new_state

STOP = shipped("stop-1")


def _learned() -> RecordArray:
    learned = new_record(LEARNED)
    learned["joint"], learned["joint_sigma"] = 0.02, 1e-4
    learned["mu_b"], learned["sigma_mu_b"], learned["observed_s"] = 0.4, 0.004, 20.0
    learned["radius_sigma"], learned["disc_excess"] = 1e-3, 0.0
    return learned


@pytest.mark.parametrize("name", [name for name, ablation in ABLATIONS.items() if ablation.forgotten])
def test_what_is_forgotten_has_its_prior_and_the_rest_stays(name: str) -> None:
    params = new_params(configured())
    everything = new_state(params, _learned())["joint"]
    less = new_state(params, forget(ABLATIONS[name], _learned()))["joint"]
    forgotten = list(ABLATIONS[name].forgotten)
    np.testing.assert_array_equal(less["x"][0, forgotten], 0.0)
    np.testing.assert_allclose(np.diag(less["p"][0])[forgotten], PRIOR[forgotten] ** 2)
    others = np.setdiff1d(np.arange(len(PRIOR)), forgotten)
    np.testing.assert_array_equal(less["x"][0, others], everything["x"][0, others])
    np.testing.assert_array_equal(np.diag(less["p"][0])[others], np.diag(everything["p"][0])[others])


def test_forgotten_linings_are_nominal() -> None:
    params = new_params(configured())
    state = new_state(params, forget(ABLATIONS["learned friction"], _learned()))
    np.testing.assert_allclose(state["friction"]["mu"], 0.45)
    assert state["joint"]["x"][0, RATIO] == pytest.approx(0.02)
    assert state["joint"]["p"][0, MASS, MASS] < PRIOR[MASS] ** 2


@pytest.mark.parametrize(("before", "heard"), [(True, False), (False, True)])
def test_motor_torque_is_missing_in_the_ten_minutes_alone(before: bool, heard: bool) -> None:
    scenario = without(ABLATIONS["motor torque, in the ten minutes"], STOP, before)
    drive, _ = drive_without(Ablation(), scenario, 0, None)
    assert bool(np.isfinite(drive.inputs["motor_torque_fl"]).any()) is heard
    assert np.isfinite(drive.inputs["wheel_speed_fl"]).any()


@pytest.mark.parametrize("name", ["balance of forces", "wheel slip"])
def test_without_what_carries_it_errors_are_more_than_twice_as_large(name: str) -> None:
    def errors(ablation: Ablation) -> list[float]:
        drive, _ = drive_without(ablation, STOP, 0, None)
        return [estimate_errors(drive, counted(drive), axle)[0] for axle in AXLES]

    with_it, without_it = errors(Ablation()), errors(ABLATIONS[name])
    assert sum(without_it) > 2.0 * sum(with_it)


def test_a_shadow_sees_the_same_drive() -> None:
    complete, _ = drive_without(Ablation(), STOP, 0, None)
    shadow, learned = drive_without(ABLATIONS["pressure by the demand"], STOP, 0, None)
    for name in ("vehicle_speed", "mu_b_fl"):
        np.testing.assert_array_equal(shadow.truth[name], complete.truth[name])
    braking = complete.outputs["braking"] > 0.5
    np.testing.assert_array_equal(shadow.outputs["braking"] > 0.5, braking)
    # Until the brakes are used both are the same ECU, then pressures are another's.
    first = int(np.argmax(braking))
    np.testing.assert_array_equal(shadow.outputs["mu_b_fl"][:first], complete.outputs["mu_b_fl"][:first])
    assert shadow.outputs["mu_b_fl"][-1] != complete.outputs["mu_b_fl"][-1]
    learned_friction = 0.45 * np.exp(learned["joint"][0, MU])
    assert learned_friction == pytest.approx(shadow.outputs["mu_b_fl"][-1], rel=0.01)


def test_the_table_has_medians_and_dashes() -> None:
    cars = [
        [Sample(name, case, True, (float(car), 2.0 * car)) for name in ABLATIONS for case in CASES]
        + [Sample("nothing", CASES[0], False, (3.0, 4.0))]
        for car in (1, 2, 9)
    ]
    table = ablation_table(cars)
    assert table.columns[:3] == ("without", "stop #1, cold", "stop #1, driven in")
    assert table.rows[0][:3] == ("nothing", "3.00/4.00", "2.00/4.00")
    assert {line[1] for line in table.rows[1:]} == {"–"}
    assert "3 cars" in table.below
