"""Wear of one application from its rows: closed forms, and beside what the ECU kept and what was true."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.results.wear import regressors_of, wear_of
from brakelab.simulation.closed_loop import new_loop, run_blocks
from brakelab.simulation.scenario import load_scenario
from ecu.contract.signals import OUTPUT
from ecu.settings.config import load_config, new_params

CONFIG = Path(__file__).parents[3] / "config"


@pytest.mark.parametrize("period", [0.01, 0.02, 0.05])
def test_the_integrals_are_closed_forms_at_any_rate_of_sampling(period):
    """Constant 1200 N m, from 90 to 30 rad/s in 6 s, 200 degC."""
    t = np.arange(0.0, 6.0, period) + 0.5 * period
    omega = 90.0 - 10.0 * t
    torque, heat = np.full(len(t), 1200.0), np.full(len(t), 200.0)
    work, rate = 1200e-6 * 60.0 * 6.0, 1200e-6 * 60.0
    square = 1200e-6**2 * (90.0**3 - 30.0**3) / 30.0
    expected = [work, 200 * work, 200**2 * work, rate, 200 * rate, square, 200 * square]
    found = regressors_of(torque, omega, heat, period, round(0.2 / period))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_a_stop_in_closed_loop_is_worth_the_same_by_rows_and_on_board():
    """Sum of the application's rows beside what the ECU kept; its energy beside the true one."""
    config = load_config(CONFIG / "suv.toml")
    params = new_params(config)
    loop = new_loop(load_scenario(CONFIG / "scenarios" / "single.toml"), config, 0)
    rows = np.concatenate([block.outputs.copy() for block in run_blocks(loop)])
    kept = loop.sides.state[0]["learned"]["wear"]["regressors"]
    by_rows = wear_of(rows[rows[:, OUTPUT["braking"]] == 1.0], params)
    np.testing.assert_allclose(by_rows.regressors[[0, 1, 2, 5, 6]], kept[[0, 1, 2, 5, 6]], rtol=0.02)
    np.testing.assert_allclose(by_rows.regressors[3:5], kept[3:5], rtol=0.08)
    np.testing.assert_allclose(by_rows.mass, (params[0]["wear_law"] * kept).sum(axis=0), rtol=0.05)
    assert (by_rows.sigma > 0.15 * by_rows.mass).all()
    heat = 1e-6 * loop.sides.vehicle.state[0]["brake_heat"]
    np.testing.assert_allclose(kept[0], heat, rtol=0.20)  # nothing was learned before
    assert (loop.sides.vehicle.state[0]["pad_wear_mass"] > 0.0).all()
