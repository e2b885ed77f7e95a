"""The disc's heat capacity over temperature, found from what a lagging thermocouple shows."""

from dataclasses import replace

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import Noise
from brakelab.identify.friction.heat_capacity import UNSHOWN, heat_capacity, undelayed
from brakelab.identify.friction.patches import CAPACITY_RISE
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.identify.friction.tables import heat_line
from brakelab.plant.disc import DISC_SHARE
from brakelab.plant.linings import Lining
from brakelab.studies.lab.brakes import r1_recording


def test_the_disc_of_the_pads_is_found(stops: Stops, columns: Columns, lining: Lining) -> None:
    found = heat_capacity(stops, columns)
    assert found.at_100 == pytest.approx(DISC_SHARE / lining.disc.heating, rel=0.03)
    assert found.rise == pytest.approx(CAPACITY_RISE, abs=found.rise_half)
    assert found.rise_half < 0.5 * CAPACITY_RISE
    assert found.lag == pytest.approx(Noise().thermocouple, abs=0.15)


def test_a_constant_capacity_is_constant(lining: Lining, columns: Columns) -> None:
    """The plant's own disc, whose xi is constant and whose temperature is shown as it is."""
    recording: Recording = r1_recording(lining, 0.0, 0)
    found = heat_capacity(find_stops(recording, columns, "R1"), columns)
    assert found.at_100 == pytest.approx(DISC_SHARE / lining.disc.heating, rel=0.01)
    assert abs(found.rise) < 2e-5
    assert abs(found.lag) < 0.1


@pytest.mark.parametrize("delay", [0.0, 3.0])
def test_a_late_thermocouple_is_put_right_by_the_work(
    recording: Recording, stops: Stops, columns: Columns, delay: float
) -> None:
    """Three seconds hide tens of kelvin at the end of a stop; one of a disc's own lag is left as it is."""
    begins = np.flatnonzero(np.diff(recording.time, prepend=-100.0) > 1.0)
    late = recording.temperature.copy()
    for begin, end in zip(begins, [*begins[1:], len(late)], strict=True):
        shown = recording.time[begin:end] - delay
        late[begin:end] = np.interp(shown, recording.time[begin:end], recording.temperature[begin:end])
    spoilt = find_stops(recording._replace(temperature=late), columns, "x")
    found = heat_capacity(spoilt, columns)
    assert found.lag == pytest.approx(delay + Noise().thermocouple, abs=0.25 + 0.2 * delay)
    mended = undelayed(spoilt, found, columns)
    off, before = (np.abs(one.temperature - stops.temperature) for one in (mended, spoilt))
    if delay == 0.0:
        assert mended is spoilt
    else:
        assert np.quantile(before, 0.95) > 25.0
        assert np.quantile(off, 0.95) < 12.0


def test_a_thermocouple_that_is_late_by_whole_stops_shows_no_disc(stops: Stops, columns: Columns) -> None:
    samples = np.diff(stops.first)
    since = np.arange(samples.sum()) - np.repeat(stops.first[:-1], samples)
    cooled = np.repeat(stops.start_temperature, samples) - 0.2 * stops.dt * since
    spoilt = replace(stops, temperature=cooled)
    found = heat_capacity(spoilt, columns)
    assert not found.known
    assert undelayed(spoilt, found, columns) is spoilt
    assert heat_line(found) == f"Disc: {UNSHOWN}."
