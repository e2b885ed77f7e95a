"""One ingredient taken away and nothing else: what is withheld, forgotten or worthless, and what stays."""

import numpy as np
import pytest

from brakelab.simulation.accuracy import AXLES, estimate_errors
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.accuracy.ablation import (
    ABLATIONS,
    CASES,
    Ablation,
    Sample,
    ablation_table,
    drive_without,
    forget,
    without,
)
from brakelab.studies.accuracy.observers import counted
from ecu.algorithm.estimation.joint.layout import LEVEL, MASS, RATIO
from ecu.algorithm.estimation.joint.learned import KEPT, LEVEL_PAUSE
from ecu.algorithm.estimation.joint.prior import LEVEL_AXLE, LEVEL_COMMON, LEVEL_WHEEL, PRIOR
from ecu.algorithm.step import new_state
from ecu.contract.records import LEARNED, RecordArray, new_record
from ecu.settings.config import new_params

pytestmark = pytest.mark.study

STOP = with_draw(shipped("stop-1"), "nominal")


def _learned() -> RecordArray:
    """Every state is 2 % off with a sigma of 0.02 %, and half of that is common to all."""
    learned = new_record(LEARNED)
    learned["joint"], learned["joint_known"] = 0.02, 1
    rows, columns = np.tril_indices(len(KEPT))
    learned["joint_covariance"] = 4e-8 * np.where(rows == columns, 1.0, 0.5)
    learned["mu_b"], learned["sigma_mu_b"], learned["observed_s"] = 0.4, 0.004, 20.0
    learned["radius_sigma"], learned["disc_excess"] = 1e-3, 0.0
    return learned


@pytest.mark.parametrize("name", [name for name, ablation in ABLATIONS.items() if ablation.forgotten])
def test_what_is_forgotten_has_its_prior_and_the_rest_stays(name: str) -> None:
    params = new_params(configured())
    everything = new_state(params, _learned())["joint"]
    less = new_state(params, forget(ABLATIONS[name], _learned()))["joint"]
    forgotten = np.array(ABLATIONS[name].forgotten)
    others = np.setdiff1d(np.arange(len(PRIOR)), forgotten)
    np.testing.assert_array_equal(less["x"][0, forgotten], 0.0)
    # A pause before the drive makes each a little less sure.
    np.testing.assert_allclose(np.sqrt(np.diag(less["p"][0]))[forgotten], PRIOR[forgotten], rtol=0.03)
    np.testing.assert_array_equal(less["p"][0][np.ix_(forgotten, others)], 0.0)
    np.testing.assert_array_equal(less["x"][0, others], everything["x"][0, others])
    among = np.ix_(others, others)
    np.testing.assert_array_equal(less["p"][0][among], everything["p"][0][among])


def test_forgotten_linings_are_nominal() -> None:
    params = new_params(configured())
    state = new_state(params, forget(ABLATIONS["learned friction"], _learned()))
    joint = state["joint"][0]
    np.testing.assert_allclose(state["estimate"]["mu"], 0.45)
    np.testing.assert_allclose(joint["x"][LEVEL : LEVEL + 4], 0.0)
    level = joint["p"][LEVEL : LEVEL + 4, LEVEL : LEVEL + 4]
    prior = LEVEL_COMMON**2 + LEVEL_AXLE**2 + LEVEL_WHEEL**2
    assert level[0, 0] == pytest.approx(prior)  # no pause makes it less sure than new
    shared = (LEVEL_COMMON**2 + LEVEL_PAUSE**2) / (prior + LEVEL_PAUSE**2)
    assert level[0, 2] == pytest.approx(shared * prior)
    assert joint["x"][RATIO] == pytest.approx(0.02)
    assert joint["p"][MASS, MASS] < PRIOR[MASS] ** 2


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
    complete, other = drive_without(Ablation(), STOP, 0, None)
    shadow, own = drive_without(ABLATIONS["pressure by the demand"], STOP, 0, None)
    for name in ("vehicle_speed", "mu_b_fl"):
        np.testing.assert_array_equal(shadow.truth[name], complete.truth[name])
    braking = complete.outputs["braking"] > 0.5
    np.testing.assert_array_equal(shadow.outputs["braking"] > 0.5, braking)
    # Until the brakes are used both are the same ECU, then pressures are another's.
    first = int(np.argmax(braking))
    np.testing.assert_array_equal(shadow.outputs["mu_b_fl"][:first], complete.outputs["mu_b_fl"][:first])
    assert shadow.outputs["mu_b_fl"][-1] != complete.outputs["mu_b_fl"][-1]
    # What each has learned of the same linings is its own, and the same within what they claim.
    level, sigma = own["mu_b"][0], own["sigma_mu_b"][0]
    assert np.all(level != other["mu_b"][0])
    np.testing.assert_array_less(np.abs(level - other["mu_b"][0]), sigma)


def test_the_table_has_medians_and_dashes() -> None:
    cars = [
        [Sample(name, case, True, (float(car), 2.0 * car)) for name in ABLATIONS for case in CASES]
        + [Sample("nothing", CASES[0], False, (3.0, 4.0))]
        for car in (1, 2, 9)
    ]
    table = ablation_table(cars)
    assert table.columns[:3] == ("without", "stop #1, cold", "stop #1, adapted")
    assert table.rows[0][:3] == ("nothing", "3.00/4.00", "2.00/4.00")
    assert {line[1] for line in table.rows[1:]} == {"–"}
    assert "3 cars" in table.below
