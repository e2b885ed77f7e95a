"""Road and dynamometer: energies against closed forms and the rig of the wear programme, the waiting rule."""

import numpy as np
import pytest

from brakelab.plant.wear_rig import AIR, TORQUE, T, wear_block
from brakelab.simulation.campaigns.wear_blocks import drawn_car
from brakelab.studies.wear.blocks import pair_of, repeated, sensitivity_table
from brakelab.studies.wear.blocks_rig import CHECK_OFF, corner_of, energy_error, run_stops

pytestmark = pytest.mark.study

CORNER = corner_of(drawn_car(1), 0)


def stop(v_in: float, v_end: float, decel: float, gap: float = 30.0) -> np.ndarray:
    return np.array([[v_in, v_end, decel, gap]])


@pytest.mark.parametrize(("v_in", "v_end", "decel"), [(30, 5, 3), (30, 5, 1), (15, 2, 1), (36, 25, 2)])
def test_the_energies_are_those_of_7_20_and_7_21(v_in: float, v_end: float, decel: float):
    """Dynamometer: all of the kinetic energy. Road: less by what drag and rolling take over the distance."""
    found = pair_of(CORNER, stop(v_in, v_end, decel))
    kinetic = 0.5 * CORNER.mass * (v_in**2 - v_end**2)
    assert found.rig.energy[0] == pytest.approx(kinetic, rel=0.004)
    distance = np.linspace(0.0, (v_in**2 - v_end**2) / (2.0 * decel), 2001)
    resistance = CORNER.rolling + CORNER.drag * (v_in**2 - 2.0 * decel * distance)
    assert found.road.energy[0] == pytest.approx(kinetic - np.trapezoid(resistance, distance), rel=0.012)
    assert energy_error(CORNER, v_in, v_end, decel) == pytest.approx(
        np.trapezoid(resistance, distance) / kinetic
    )
    assert found.energy_error == pytest.approx(energy_error(CORNER, v_in, v_end, decel), abs=0.01)
    assert found.rig.seconds[0] == pytest.approx(found.road.seconds[0], abs=0.2)


def test_figure_7_11_fast_and_gentle_brakings_are_reproduced_worst():
    errors = np.array(
        [[energy_error(CORNER, v, 0.0, a) for v in (10.0, 20.0, 35.0)] for a in (1.0, 2.0, 4.0)]
    )
    assert (np.diff(errors, axis=1) > 0.0).all()
    assert (np.diff(errors, axis=0) < 0.0).all()


def test_wear_is_that_of_the_programme_s_rig_from_the_same_disc():
    """`wear_block` at a fifth of the step; both begin at the air's temperature."""
    stops, trace = stop(28.0, 3.0, 2.5, 0.0), np.zeros((4000, 5))
    rows, worn = wear_block(CORNER.car[0], 0, CORNER.mass, CORNER.radius, stops, 15.0, trace)
    mine = run_stops(CORNER, stops, 15.0, np.array([AIR]))
    assert mine.worn[0] == pytest.approx(worn - 15.0, rel=0.01)
    work = np.sum((trace[: rows - 1, TORQUE] * trace[: rows - 1, 1]) * np.diff(trace[:rows, T]))
    assert mine.energy[0] == pytest.approx(work, rel=0.01)


def test_the_next_braking_waits_for_the_road_s_disc_but_not_below_65_degrees():
    stops = np.concatenate([stop(30.0, 1.0, 3.0, 10.0)] * 4)
    hot = run_stops(CORNER, stops, 15.0, np.full(4, 90.0))
    assert (hot.heat_in[1:] <= 90.0).all()
    assert (hot.heat_in[1:] > 80.0).all()
    cold = run_stops(CORNER, stops, 15.0, np.full(4, 25.0))
    assert (cold.heat_in[1:] <= CHECK_OFF).all()
    assert (cold.heat_in[1:] > CHECK_OFF - 8.0).all()
    assert cold.waited[1:].min() > hot.waited[1:].min()


def test_new_linings_wear_more_at_first():
    found = repeated(CORNER, np.concatenate([stop(35.0, 20.0, 6.0)] * 40), 3)
    assert found.rig[0] > 1.1 * found.rig[-1]
    assert 0.01 < found.without_weather < 0.2
    assert (np.diff(found.energy) > 0.0).all()


@pytest.mark.parametrize("hot", ["first", "second"])
def test_the_page_names_the_block_that_reacts_most_to_heat(hot: str) -> None:
    """Regressors of (7.16): 10 MJ at 70 and at 200 degC."""
    cool = np.array([10.0, 700.0, 5e4, 8.0, 600.0, 0.2, 15.0])
    heated = np.array([10.0, 2000.0, 4e5, 8.0, 1700.0, 0.9, 150.0])
    table = sensitivity_table({name: heated if name == hot else cool for name in ("first", "second")})
    assert f"extended law 6.2 % in {hot}, quasi-static law 6.8 % in {hot}" in table.below
