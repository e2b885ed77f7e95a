"""Which samples count, and that a replayed drive gives what the ECU gave while it drove."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.tuning.recording import (
    SHORTEST_S,
    applications,
    drive_errors,
    drive_once,
    mean_errors,
    recording,
)
from brakelab.identify.tuning.replay import replay_errors
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import with_observer
from brakelab.simulation.scenario import load_scenario
from ecu.contract.records import new_record
from ecu.settings.config import Config


def driven(braking: list[tuple[float, float]], until: float, slow_from: float) -> Drive:
    """A made-up drive with brake applications [s]; from `slow_from` on at 4 m/s, before at 20 m/s."""
    t = np.arange(round(100 * until)) * 0.01
    on = np.any([(t > start - 0.005) & (t < end - 0.005) for start, end in braking], axis=0)
    speed = np.where(t > slow_from - 0.005, 4.0, 20.0)
    return Drive(t, {}, {"braking": on.astype(float)}, {"vehicle_speed": speed}, new_record(np.dtype("u1")))


COUNTED = [
    # applications [s], end, below 15 km/h from, what counts [s]
    ([(1.0, 3.0)], 5.0, 9.0, [(1.5, 3.0)]),
    ([(1.0, 3.0)], 5.0, 2.5, [(1.5, 2.5)]),
    ([(1.0, 3.0), (3.5, 6.0)], 7.0, 9.0, [(1.5, 3.0), (4.0, 6.0)]),
    ([(1.0, 5.0)], 5.0, 9.0, [(1.5, 5.0)]),
    ([(0.0, 2.0)], 5.0, 9.0, [(0.5, 2.0)]),
    ([(1.0, 1.9), (2.5, 4.0)], 5.0, 9.0, [(3.0, 4.0)]),  # the first counts for 0.4 s only
    ([(1.0, 3.0)], 5.0, 1.2, []),
]


@pytest.mark.parametrize(("braking", "until", "slow_from", "expected"), COUNTED)
def test_an_application_counts_from_half_a_second_on_down_to_15_km_h(
    braking, until, slow_from, expected
) -> None:
    numbers = applications(driven(braking, until, slow_from))
    assert numbers.max() == len(expected) - 1
    for number, (start, end) in enumerate(expected):
        rows = np.flatnonzero(numbers == number)
        assert (rows[0], rows[-1] + 1) == (round(100 * start), round(100 * end))
        assert len(rows) >= 100 * SHORTEST_S


def test_a_replayed_drive_gives_the_errors_of_the_drive(stop: Path, manual: Config) -> None:
    """The drive's are computed from its decoded columns; the replay decodes frames and steps again."""
    drives = [drive_once(load_scenario(stop), manual, seed) for seed in (0, 1)]
    closed = mean_errors(map(drive_errors, drives))
    (replayed,) = replay_errors(map(recording, drives), [manual])
    np.testing.assert_allclose(replayed.nrmse, closed.nrmse, rtol=1e-9)
    np.testing.assert_allclose(replayed.inside_2_sigma, closed.inside_2_sigma, rtol=1e-9)
    assert (closed.nrmse > 1.0).all(), "an observer that is not perfect"


def test_a_tuning_moves_the_car_by_less_than_it_moves_its_own_error(stop: Path, manual: Config) -> None:
    """Open loop is good enough to choose by: another tuning, in replay and driven."""
    scenario = load_scenario(stop)
    other = with_observer(manual, mu_drift=0.08, omega_walk=8.0)
    kept = recording(drive_once(scenario, manual, 0))
    before, after = replay_errors([kept], [manual, other])
    drawn = drive_errors(run(new_loop(scenario, other, 0)))
    assert np.abs(after.nrmse - before.nrmse).min() > 0.3
    assert np.abs(after.nrmse - drawn.nrmse).max() < 0.3 * np.abs(after.nrmse - before.nrmse).min()


def test_tunings_in_one_call_do_not_touch_each_other(stop: Path, manual: Config) -> None:
    kept = [recording(drive_once(load_scenario(stop), manual, 0))]
    other = with_observer(manual, mu_drift=0.08)
    together = replay_errors(kept, [manual, other, manual])
    alone = [replay_errors(kept, [config])[0] for config in (manual, other, manual)]
    np.testing.assert_array_equal([e.nrmse for e in together], [e.nrmse for e in alone])
    assert not np.allclose(together[0].nrmse, together[1].nrmse)


def test_a_drive_without_brakes_has_no_error(manual: Config) -> None:
    errors = drive_errors(driven([(1.0, 3.0)], 5.0, 1.2))
    assert np.isnan(errors.nrmse).all()
