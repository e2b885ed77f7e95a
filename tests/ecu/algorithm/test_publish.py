import numpy as np
import pytest

from ecu.algorithm.publish import publish
from ecu.algorithm.step import new_state
from ecu.contract.records import INPUTS, OUTPUTS
from ecu.contract.signals import ACTIVE, DEGRADED, FAILED
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

PRESSURES = [30e5, 31e5, 0.0, 12e5]  # Pa


def torques(params, bar, mu):
    """(A.19), N m."""
    pressing = np.maximum(np.array(bar) * 1e5 - params["push_out_pressure"], 0.0)
    return 2 * params["piston_area"] * params["effective_radius"] * mu * pressing


@pytest.mark.parametrize(
    ("mode", "bar"),
    [(ACTIVE, [30.0, 31.0, 0.0, 12.0]), (DEGRADED, [30.0, 31.0, 0.0, 12.0]), (FAILED, [0.0, 0.0, 0.0, 0.0])],
)
@pytest.mark.requirement("REQ-DEM-1")
def test_demands_are_sent_in_bar_and_a_failed_ecu_demands_no_pressure(mode: int, bar: list[float]) -> None:
    params = new_params(load_config(resource("config/suv-blended.toml")))
    state, outputs = new_state(params), np.full(1, np.nan, OUTPUTS)
    state["limiter"]["pressure"] = PRESSURES
    state["demands"]["uncompensated"], state["demands"]["motor"] = 28e5, 400.0
    publish(params[0], state[0], np.zeros(1, INPUTS)[0], outputs[0], 3.0, 0, mode)
    assert outputs["pressure_demand"][0] == pytest.approx(bar)
    assert outputs["torque_demand"][0] == pytest.approx(torques(params[0], bar, state[0]["control"]["used"]))
    assert outputs["pressure_uncompensated"][0] == pytest.approx([28.0] * 4)
    assert outputs["motor_demand"][0] == pytest.approx([400.0] * 4)
    assert state["limiter"]["pressure"][0] == pytest.approx(PRESSURES)


def test_what_remains_of_linings_is_unknown_until_somebody_says_what_is_fitted() -> None:
    params = new_params(load_config(resource("config/suv.toml")))
    params["mapped"] = 1
    state, outputs = new_state(params), np.full(1, np.nan, OUTPUTS)
    wear = state["learned"]["wear"][0]
    wear["told"], wear["measurements"] = [1, 0, 0, 0], [0, 1, 0, 0]
    publish(params[0], state[0], np.zeros(1, INPUTS)[0], outputs[0], 3.0, 0, ACTIVE)
    assert np.isfinite(outputs["pad_remaining"][0]).tolist() == [True, True, False, False]
    assert np.isfinite(outputs["sigma_pad_wear"][0]).all()
