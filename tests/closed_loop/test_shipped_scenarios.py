"""Every shipped scenario in closed loop: it ends as it should and shows what its header promises."""

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import LONGEST_DRIVE, load_scenario
from brakelab.simulation.scenario_car import with_draw
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[2] / "config"
CUT = 60.0
"""s; of a scenario that lasts longer only this is driven, but for three whose end is of interest."""
WHOLE = ("fade", "downhill", "snow")
ROWS = NDArray[np.float64]


class Fact(NamedTuple):
    """What is expected of one scenario."""

    seconds: tuple[float, float]
    """How long it lasts; above CUT: it goes on."""
    end: float
    """Speed at the end, m/s; NaN: cut."""
    fastest: float
    """m/s; NaN: what the trace asks for, see below."""
    decel: tuple[float, float]
    """Range that holds the steady deceleration, m/s^2."""
    lateral: tuple[float, float] = (0.0, 0.3)
    """Range that holds the largest lateral acceleration, m/s^2."""
    disc: tuple[float, float] = (100.0, 250.0)
    """Range that holds the hottest disc's temperature, degC."""


LONG = (CUT, CUT)
CUT_OFF = math.nan
# Where the demand is 4 m/s^2 the car has drag and rolling resistance beside it: 0.1 to 0.3 m/s^2.
FACTS = {
    #                        seconds          end      fastest  decel       lateral     hottest disc
    "blending-0": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "blending-20": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "blending-40": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "blending-60": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "blending-80": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "charge-limit": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),  # this ECU's motors rest
    "bursts": Fact((40, 55), 0.0, 27.8, (2.0, 2.5)),  # Table 6.1: 1.5 to 1.6 with another pedal
    "curve": Fact((12, 16), 0.0, 22.4, (2.9, 3.5), (5.0, 9.0)),
    "demo": Fact((50, 58), 0.0, 27.8, (5.0, 6.5)),
    "downhill": Fact((177, 179), 0.0, 14.0, (0.5, 0.9), disc=(200, 300)),
    "fade": Fact((140, 170), 5.6, 27.8, (3.3, 3.6), disc=(350, 500)),
    "fade-descent": Fact((26, 28), 0.0, 40.0, (2.9, 3.5), disc=(300, 400)),
    "fixed-decel": Fact(LONG, CUT_OFF, 13.9, (1.2, 1.4)),
    "fixed-pedal": Fact(LONG, CUT_OFF, 27.8, (0.9, 1.1)),  # Table 6.1: about 1
    "hand-over": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "motor-loss": Fact((7, 8), 0.0, 20.8, (3.9, 4.4)),
    "identify": Fact(LONG, CUT_OFF, 24.9, (0.0, 0.0), (1.5, 2.9)),  # on the motors for the first minute
    "lane-change": Fact((8.9, 9.1), 22.2, 22.3, (-0.2, 0.2), (4.0, 7.0)),
    "low-grip": Fact((5, 8), 0.0, 20.8, (4.0, 5.0)),
    "ordinary": Fact(LONG, CUT_OFF, 25.0, (0.0, 0.0), (1.5, 2.6)),  # on the motors for the first minute
    "rain": Fact(LONG, CUT_OFF, 33.4, (2.9, 3.4)),
    "real-driving": Fact(LONG, CUT_OFF, math.nan, (0.0, 2.5), disc=(20, 60)),
    "repeated": Fact((14, 17), 0.0, 36.2, (4.0, 4.5)),
    "repeated-blended": Fact((14, 17), 0.0, 36.2, (4.0, 4.5)),
    "repeated-slow": Fact((15, 18), 0.0, 36.1, (4.0, 4.5)),
    "sensitivity": Fact(LONG, CUT_OFF, 27.8, (0.7, 1.0)),
    "single": Fact((6, 8), 0.0, 20.8, (3.9, 4.5)),
    "snow": Fact((65, 71), 0.0, 25.0, (3.9, 4.4), disc=(100, 200)),
    "split": Fact((6.4, 6.6), 18.7, 22.3, (1.5, 2.3), (0.5, 4.0)),
    "staircase": Fact((30, 60), 27.0, 27.8, (4.0, 5.3)),
    "stop-1": Fact((13, 16), 0.0, 33.4, (3.8, 4.4)),
    "stop-2": Fact((10, 12), 0.0, 33.4, (6.7, 7.5)),
    "stop-3": Fact((13, 16), 0.0, 33.4, (3.8, 4.4)),
    "stop-4": Fact((10, 14), 0.0, 33.4, (5.7, 6.5)),
    "type-0": Fact((5, 6), 0.0, 27.8, (8.0, 8.7)),
    "type-0-laden": Fact((5, 6), 0.0, 27.8, (8.0, 8.7)),
    "tyre-stiffness": Fact((8, 10), 0.0, 27.8, (3.9, 4.4)),
    "wltp-brake": Fact(LONG, CUT_OFF, math.nan, (0.0, 2.5), disc=(20, 60)),
}


@cache
def driven(name: str, armed: bool = True) -> Drive:
    """Return the drive of one car, cut after CUT where it is long; unarmed the hydraulics brake alone."""
    scenario, config = load_scenario(CONFIG / "scenarios" / f"{name}.toml"), load_config(CONFIG / "suv.toml")
    return run(
        new_loop(with_draw(scenario, "nominal"), config, 1, armed),
        seconds=LONGEST_DRIVE if name in WHOLE else CUT,
    )


def braking(drive: Drive) -> ROWS:
    """Return the places of a drive in which the brakes are on and nothing starts or ends."""
    on = sum(drive.truth[f"calliper_pressure_{corner}"] for corner in CORNERS) > 6.0
    steady = np.convolve(on, np.ones(101), "same") > 100.5
    return np.flatnonzero(steady & (drive.truth["vehicle_speed"] > 0.5))


def test_every_shipped_scenario_has_its_facts() -> None:
    assert {path.stem for path in (CONFIG / "scenarios").glob("*.toml")} == set(FACTS)


@pytest.mark.parametrize("name", FACTS)
def test_a_scenario_shows_what_it_should(name: str) -> None:
    drive, fact = driven(name), FACTS[name]
    truth, speed = drive.truth, drive.truth["vehicle_speed"]
    assert all(np.isfinite(column).all() for column in truth.values())
    assert fact.seconds[0] - 0.1 <= drive.t[-1] <= fact.seconds[1] + 0.1
    assert math.isnan(fact.end) or speed[-1] == pytest.approx(fact.end, abs=0.15)
    assert math.isnan(fact.fastest) or speed.max() == pytest.approx(fact.fastest, abs=0.1)
    steady = braking(drive)
    decel = float(np.percentile(-truth["accel_x_road"][steady], 90)) if len(steady) else 0.0
    lateral = float(np.abs(truth["accel_y"]).max())
    disc = max(float(truth[f"disc_temperature_{corner}"].max()) for corner in CORNERS)
    print(f"{name}: {drive.t[-1]:.1f} s, {decel:.2f} m/s^2, across {lateral:.2f} m/s^2, disc {disc:.0f} degC")
    for value, (low, high) in ((decel, fact.decel), (lateral, fact.lateral), (disc, fact.disc)):
        assert low <= value <= high


def test_friction_has_less_to_do_the_more_the_motors_take() -> None:
    heat = []
    for percent in (0, 20, 40, 60, 80):
        truth = driven(f"blending-{percent}").truth
        heat.append(sum(np.sum(truth[f"brake_torque_{c}"] * truth[f"wheel_speed_{c}"]) for c in CORNERS))
    share = np.array(heat) / heat[0]
    print("heat of the brakes", np.round(share, 3))
    assert share == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2], abs=0.05)


def test_the_lane_change_touches_no_cone() -> None:
    """ISO 3888-1: lanes of 1.1, 1.2 and 1.3 car widths and 0.25 m.

    Assumption: a car 4.5 m long and 1.86 m wide, lanes 3.5 m apart from middle to middle.
    """
    truth = driven("lane-change").truth
    sine, cosine = np.sin(truth["heading"]), np.cos(truth["heading"])
    for begin, end, middle, widths in ((50, 65, 0.0, 1.1), (95, 120, 3.5, 1.2), (145, 175, 0.0, 1.3)):
        for along, left in ((2.2, 0.93), (2.2, -0.93), (-2.3, 0.93), (-2.3, -0.93)):
            x = truth["position_x"] + along * cosine - left * sine
            y = truth["position_y"] + along * sine + left * cosine
            inside = (x > begin) & (x < end)
            assert np.abs(y[inside] - middle).max() < 0.5 * (1.86 * widths + 0.25)


def test_braking_in_the_curve_turns_the_car_in_but_it_stays_on_its_wheels() -> None:
    truth = driven("curve").truth
    steady, braked = truth["yaw_rate"][600:700], truth["yaw_rate"][700:]
    assert steady.mean() == pytest.approx(0.22, abs=0.01)  # 22.4 m/s on 100 m
    assert 1.1 < braked.max() / steady.mean() < 2.0
    assert min(truth[f"wheel_force_z_{c}"].min() for c in CORNERS) > 300.0


def test_on_split_friction_the_left_wheels_slip_but_roll_and_the_car_drifts_to_the_right() -> None:
    truth = driven("split").truth
    assert -0.5 < truth["slip_fl"].min() < -0.1
    assert truth["slip_fr"].min() > -0.1
    assert -0.1 < truth["heading"][-1] < -0.02
    assert truth["position_y"][-1] < -1.0


def test_the_patch_is_met_at_2_s_and_locks_the_wheels() -> None:
    drive = driven("low-grip")
    locked = drive.t[drive.truth["slip_fl"] < -0.5]
    assert locked[0] == pytest.approx(2.1, abs=0.1)
    on_patch = (drive.t > 2.35) & (drive.t < 2.5)
    # Sliding, all four would give 0.62 of the road's 0.2; some slide, some are released.
    assert -drive.truth["accel_x_road"][on_patch].mean() == pytest.approx(0.2 * 9.81 * 0.62, rel=0.2)
    assert drive.truth["slip_fl"][drive.t > 3.2].min() > -0.1


def test_the_tyre_slips_more_from_4_s_on() -> None:
    drive = driven("tyre-stiffness")
    force, slip = drive.truth["wheel_force_x_fl"], drive.truth["slip_fl"]
    times = [(drive.t > start) & (drive.t < start + 0.4) for start in (3.5, 4.3)]
    before, after = (force[chosen].mean() / slip[chosen].mean() for chosen in times)
    assert after / before == pytest.approx(0.67, abs=0.01)


@pytest.mark.parametrize(("armed", "pressed_more"), [(True, (0.0, 3.0)), (False, (5.0, 20.0))])
def test_friction_fades_and_the_pedal_makes_up_for_it_where_no_ecu_does(
    armed: bool, pressed_more: tuple[float, float]
) -> None:
    """Section 6.2.3 and Figure 6.3: the pedal goes down further from braking to braking."""
    drive = driven("fade", armed)
    steady = braking(drive)
    first, last = steady[steady < 700], steady[steady > len(drive.t) - 500]
    friction = [float(drive.truth["mu_b_fl"][places].mean()) for places in (first, last)]
    pedal = [float(drive.truth["pedal_position"][places].mean()) for places in (first, last)]
    print(f"armed {armed}: friction {np.round(friction, 3)}, pedal {np.round(pedal, 1)} %")
    assert friction[1] < 0.85 * friction[0]
    assert pressed_more[0] <= pedal[1] - pedal[0] <= pressed_more[1]


def test_rain_is_on_the_bus_and_in_no_dry_scenario() -> None:
    for name, rain in (("rain", 1.0), ("stop-3", 0.0)):
        heard = driven(name).inputs["rain"]
        assert set(heard[np.isfinite(heard)]) == {rain}


def test_the_cycle_is_followed() -> None:
    scenario = load_scenario(CONFIG / "scenarios" / "real-driving.toml")
    drive = driven("real-driving")
    t, speed = scenario.script().trace.T
    error = drive.truth["vehicle_speed"] - np.interp(drive.t, t, speed)
    print(f"error of speed: {error.std():.3f} m/s, at most {np.abs(error).max():.2f} m/s")
    assert error.std() < 0.12
    assert np.abs(error).max() < 0.6
