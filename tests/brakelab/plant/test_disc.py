"""The disc: Biot number, rain, and the table of errata on cooling with both values of delta_1."""

import pytest

from brakelab.plant.description import Plant
from brakelab.plant.disc import biot_number, cooling_rate, disc_step
from brakelab.plant.dynamometer import cool
from brakelab.plant.linings import rig_with

KMH = (0, 30, 60, 100, 130)


@pytest.mark.parametrize(
    ("brake", "seconds"),
    [("A", (870, 166, 92, 58, 45)), ("B", (1007, 192, 106, 67, 52)), ("C", (728, 139, 77, 48, 38))],
)
def test_cooling_as_printed_takes_a_minute_from_400_to_100(
    suv: Plant, brake: str, seconds: tuple[int, ...]
) -> None:
    rig = rig_with(suv.linings.lining[brake], "R1")
    rig["cooling_by_speed"] *= 10.0
    assert [round(cool(rig, speed / 3.6, 400.0, 100.0)) for speed in KMH] == pytest.approx(seconds, abs=1)


@pytest.mark.parametrize(("brake", "seconds"), [("A", 361), ("B", 418), ("C", 302)])
def test_cooling_with_a_tenth_takes_minutes(suv: Plant, brake: str, seconds: int) -> None:
    rig = rig_with(suv.linings.lining[brake], "SIM")
    assert cool(rig, 100.0 / 3.6, 400.0, 100.0) == pytest.approx(seconds, abs=1)


def test_steps_of_the_disc_cool_as_fast_as_the_closed_form(suv: Plant) -> None:
    rig = rig_with(suv.linings.lining["A"], "SIM")[0]
    rate = cooling_rate(rig["cooling"], rig["cooling_by_speed"], 25.0, 0.0)
    temperature, seconds = 400.0, 0.0
    while temperature > 100.0:
        temperature = disc_step(temperature, 0.0, rate, 0.0, 20.0, 0.01)
        seconds += 0.01
    assert seconds == pytest.approx(
        cool(rig_with(suv.linings.lining["A"], "SIM"), 25.0, 400.0, 100.0), rel=1e-4
    )


def test_rain_cools_only_a_disc_that_turns() -> None:
    assert cooling_rate(2e-3, 1e-4, 0.0, 1.0) == cooling_rate(2e-3, 1e-4, 0.0, 0.0) == 2e-3
    assert cooling_rate(2e-3, 1e-4, 30.0, 1.0) == pytest.approx(2e-3 + 2 * 3e-3)
    assert cooling_rate(2e-3, 1e-4, -30.0, 0.5) == pytest.approx(2e-3 + 1.5 * 3e-3)


def test_biot_number_is_film_times_radius_over_conductivity() -> None:
    # A disc of 9.1 kg at 500 J/(kg K) that loses 132 W/K over 0.159 m^2: 830 W/(m^2 K).
    assert biot_number(2.111e-4, 132.0 / 4548.0, 0.159, 0.183) == pytest.approx(830 * 0.183 / 50, rel=2e-3)
