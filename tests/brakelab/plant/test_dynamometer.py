"""The dynamometer: Table 3.4 replayed and in closed loop, closed forms, invariance, programmes."""

import math
from pathlib import Path

import numpy as np
import pytest

from brakelab.plant.description import Plant, PlantFileError
from brakelab.plant.dynamometer import (
    DECELERATION,
    DRAG,
    PRESSURE,
    REPLAY,
    mean_friction,
    new_stop,
    nominal_friction,
    run_stop,
)
from brakelab.plant.dynamometer_programme import Gate, bring_to, load_programme, run_programme
from brakelab.plant.friction.ilvo import SPEED
from brakelab.plant.linings import rig_with
from brakelab.plant.records import RecordArray

RIG_CONFIG = Path(__file__).parents[3] / "config" / "rig"
START, END = 100.0 / 3.6, 5.0 / 3.6
GRID = (50.0, 100.0, 150.0, 200.0, 250.0, 300.0)
MEASURED = {
    "A": (0.4338, 0.4711, 0.4584, 0.4291, 0.4030, 0.3775),
    "B": (0.3929, 0.4843, 0.5424, 0.5303, 0.5094, 0.4959),
    "C": (0.3756, 0.4229, 0.3843, 0.3340, 0.3005, 0.2773),
}
R1 = {
    "A": (0.4511, 0.4707, 0.4649, 0.4462, 0.4241, 0.3966),
    "B": (0.3830, 0.4330, 0.4722, 0.4907, 0.5025, 0.5133),
    "C": (0.4084, 0.4400, 0.4308, 0.4039, 0.3768, 0.3503),
}
R2 = {
    "A": (0.4708, 0.4774, 0.4680, 0.4480, 0.4233, 0.3921),
    "B": (0.4047, 0.4401, 0.4711, 0.4895, 0.5021, 0.5123),
    "C": (0.4161, 0.4364, 0.4290, 0.4060, 0.3793, 0.3501),
}
"""Independently computed from the same equations."""


def carrying(suv: Plant, brake: str, law: str, printed_cooling: bool = False) -> RecordArray:
    rig = rig_with(suv.linings.lining[brake], law)
    if printed_cooling:
        rig["cooling_by_speed"] *= 10.0
    return rig


@pytest.mark.parametrize("brake", ["A", "B", "C"])
@pytest.mark.parametrize(("law", "by_distance", "expected"), [("R1", False, R1), ("R2", True, R2)])
def test_replayed_pressure_gives_the_re_identified_table(
    suv: Plant, brake: str, law: str, by_distance: bool, expected: dict[str, tuple[float, ...]]
) -> None:
    rig = carrying(suv, brake, law, printed_cooling=True)
    found = [
        mean_friction(
            run_stop(rig, new_stop(REPLAY, START, END, tau, deceleration=9.81, measured_mu=mu)), by_distance
        )
        for tau, mu in zip(GRID, MEASURED[brake], strict=True)
    ]
    assert found == pytest.approx(expected[brake], abs=5e-4)


@pytest.mark.parametrize("brake", ["A", "B", "C"])
def test_the_bounded_law_reproduces_all_measured_means_in_closed_loop(suv: Plant, brake: str) -> None:
    rig = carrying(suv, brake, "SIM")
    found = [
        mean_friction(run_stop(rig, new_stop(DECELERATION, START, END, tau, deceleration=9.81)))
        for tau in GRID
    ]
    assert found == pytest.approx(MEASURED[brake], rel=2e-3)


@pytest.mark.parametrize(("brake", "expected"), [("A", 0.455), ("B", 0.462), ("C", 0.409)])
def test_nominal_friction_of_the_re_identified_law(suv: Plant, brake: str, expected: float) -> None:
    assert nominal_friction(carrying(suv, brake, "SIM")) == pytest.approx(expected, abs=6e-4)


@pytest.mark.parametrize("brake", ["A", "B", "C"])
def test_mean_friction_of_r1_knows_no_pressure(suv: Plant, brake: str) -> None:
    """Without cooling, d alpha / d omega holds no pressure: a stop's mean over distance cannot either."""
    rig = carrying(suv, brake, "R1")
    rig["cooling"] = rig["cooling_by_speed"] = 0.0
    means = []
    for bar in (10.0, 20.0, 60.0, 120.0):
        stop = new_stop(PRESSURE, START, END, 100.0, pressure=1e5 * bar)
        stop["ramp"] = 1e-9
        means.append(mean_friction(run_stop(rig, stop, dt=2e-2 / bar)))
    print(brake, means)
    assert means == pytest.approx([means[0]] * 4, rel=5e-4)


@pytest.mark.parametrize(("brake", "rise"), [("A", 88.0), ("B", 30.0), ("C", 52.0)])
def test_without_cooling_the_disc_keeps_the_flywheels_energy(suv: Plant, brake: str, rise: float) -> None:
    rig = carrying(suv, brake, "R1")
    rig["cooling"] = rig["cooling_by_speed"] = 0.0
    trace = run_stop(rig, new_stop(DECELERATION, START, 0.01, 50.0, deceleration=9.81))
    expected = 0.5 * rig[0]["mass"] * START**2 * rig[0]["heating"]
    assert trace["temperature"][-1] - 50.0 == pytest.approx(expected, rel=2e-3)
    assert expected == pytest.approx(rise, abs=0.8)


def test_closed_loop_holds_the_deceleration(suv: Plant) -> None:
    trace = run_stop(carrying(suv, "B", "SIM"), new_stop(DECELERATION, START, END, 150.0, deceleration=6.0))
    full = trace[trace["share"] >= 1.0]
    assert np.diff(full["speed"]) / np.diff(full["t"]) == pytest.approx(-6.0, rel=5e-3)
    # Braked distance: v^2 / 2a, and half the ramp at the initial speed (less a ramp^2 / 24).
    distance = trace["speed"].sum() * 1e-3
    assert distance == pytest.approx((START**2 - END**2) / 12.0 + START * 0.075, rel=2e-3)


def test_a_brake_without_friction_gets_all_the_pressure_there_is_and_no_nan(suv: Plant) -> None:
    rig = carrying(suv, "A", "R1")
    rig["row"][0, 1:5] = 0.0  # no adhesion, no growth
    trace = run_stop(rig, new_stop(DECELERATION, START, END, 100.0, deceleration=9.81), longest=2.0)
    assert len(trace) == 2000
    assert trace["pressure"].max() == 210e5
    assert np.all(np.isfinite(trace["temperature"]))
    assert np.all(trace["torque"] == 0.0)


def test_a_drag_holds_speed_until_the_disc_is_warm(suv: Plant) -> None:
    drag = new_stop(DRAG, 20.0, 0.0, 60.0, pressure=15e5, end_temperature=120.0)
    trace = run_stop(carrying(suv, "A", "SIM"), drag)
    assert np.all(trace["speed"] == 20.0)
    assert trace["temperature"][-1] == pytest.approx(120.0, abs=0.05)


def test_a_long_drag_takes_all_contact_from_r1(suv: Plant) -> None:
    """The heat term alone: contact falls by c sigma T per second; debris needs a disc that slows."""
    rig = carrying(suv, "A", "R1")
    rig["row"][0, SPEED] = rig["heating"] = rig["cooling"] = rig["cooling_by_speed"] = 0.0
    drag = new_stop(DRAG, 20.0, 0.0, 400.0 - 273.15, pressure=20e5)
    drag["ramp"] = 1e-9
    trace = run_stop(rig, drag, longest=30.0)
    seconds = 1.0 / (1.226e-10 * 20e5 * 2.827e-3 / 7.125e-3 * 400.0)
    assert trace["t"][np.argmax(trace["memory"] == 0.0)] == pytest.approx(seconds, rel=1e-3)
    assert seconds == pytest.approx(26.0, abs=0.5)


def test_halving_the_step_changes_a_stop_by_less_than_a_thousandth(suv: Plant) -> None:
    for law in suv.linings.lining["A"].friction:
        means, distances = [], []
        for dt in (1e-3, 5e-4):
            stop = new_stop(PRESSURE, START, END, 100.0, pressure=30e5)
            trace = run_stop(carrying(suv, "A", law), stop, dt)
            means.append(mean_friction(trace))
            distances.append(trace["speed"].sum() * dt)
        assert means[0] == pytest.approx(means[1], rel=1e-3), law
        assert distances[0] == pytest.approx(distances[1], rel=1e-3), law


@pytest.mark.parametrize(("name", "stops"), [("ams", 6), ("cpc", 5 * 7 * 9)])
def test_programmes_meet_their_gates(suv: Plant, name: str, stops: int) -> None:
    results = run_programme(load_programme(RIG_CONFIG / f"{name}.toml"), carrying(suv, "A", "SIM"))
    assert len({(stop.speed, stop.level, stop.temperature) for stop in results}) == stops
    for stop in results:
        assert stop.start_temperature == pytest.approx(stop.temperature)
        assert stop.end_temperature > stop.start_temperature
        assert 0.3 < stop.mean_by_distance < 0.6


def test_a_gate_cools_by_the_air_and_warms_by_drags(suv: Plant) -> None:
    gate, rig = Gate(warm_speed=80.0, warm_pressure=20.0, cool_speed=50.0), carrying(suv, "A", "SIM")
    cooled = bring_to(rig, gate, 200.0, 100.0)
    rate = 1.792e-3 + 9.108e-5 * 50.0 / 3.6
    assert (cooled.temperature, cooled.seconds) == (100.0, pytest.approx(math.log(180.0 / 80.0) / rate))
    warmed = bring_to(rig, gate, 20.0, 200.0)
    assert warmed.temperature == 200.0
    assert warmed.seconds > 5.0


def test_a_gate_gives_up_on_a_brake_that_cannot_warm(suv: Plant) -> None:
    gate = Gate(warm_speed=1.0, warm_pressure=0.1, cool_speed=50.0)
    reached = bring_to(carrying(suv, "A", "SIM"), gate, 20.0, 300.0)
    assert reached.temperature < 300.0
    assert reached.seconds == pytest.approx(500.0)


@pytest.mark.parametrize(
    ("edit", "place"),
    [(("speed = [100.0]", "speed = []"), "speed"), (("deceleration", "torque"), "control")],
)
def test_a_mistake_in_a_programme_is_one_line(tmp_path: Path, edit: tuple[str, str], place: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((RIG_CONFIG / "ams.toml").read_text().replace(*edit))
    with pytest.raises(PlantFileError) as caught:
        load_programme(path)
    assert caught.value.place == place
