"""Stops in a recording, and friction by least squares."""

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns, Rig
from brakelab.identify.friction.recording import Recording, joined
from brakelab.identify.friction.stops import Stops, find_stops, some
from brakelab.results.torque_friction import friction_over_time
from ecu.errors import UserError


def test_every_stop_is_found(stops: Stops) -> None:
    assert len(stops) == 24
    assert stops.per_block == 10
    assert sorted(set(np.round(1e-5 * stops.held_pressure / 5.0) * 5.0)) == [15.0, 30.0, 50.0, 70.0]


def test_what_is_between_stops_is_no_stop(recording: Recording, columns: Columns) -> None:
    """A drag at constant speed, a dab of 0.2 s and a released brake beside the stops."""
    time = np.arange(0.0, 10.0, 0.005)
    pressure = np.where(time < 5.0, 20e5, np.where((time > 7.0) & (time < 7.2), 30e5, 0.0))
    drag = Recording(
        recording.time[-1] + 50.0 + time,
        pressure,
        2e-4 * pressure,
        np.full_like(time, 60.0),
        100.0 + 0.0 * time,
    )
    assert len(find_stops(joined([recording, drag]), columns, "x")) == 24
    with pytest.raises(UserError, match="no stop found"):
        find_stops(drag, columns, "drag.csv")


def test_the_inertia_follows_from_torque_and_speed(recording: Recording, columns: Columns) -> None:
    free = columns.model_copy(update={"rig": Rig()})
    assert find_stops(recording, free, "x").inertia == pytest.approx(columns.rig.inertia, rel=0.01)


def test_recursive_least_squares_end_where_batch_least_squares_are() -> None:
    """Without forgetting both are the same sum; with it a step is followed within its memory."""
    random = np.random.default_rng(0)
    pressure = 30e5 + 5e5 * np.sin(np.arange(2000) / 50.0)
    lever = 8.25e-4
    truth = np.where(np.arange(2000) < 1000, 0.35, 0.45)
    torque = lever * pressure * truth + 5.0 * random.standard_normal(2000)
    found = friction_over_time(torque, pressure, lever, 0.005)
    assert found[990] == pytest.approx(0.35, abs=0.002)
    assert found[1020] == pytest.approx(0.35 + 0.1 * (1.0 - np.exp(-1.0)), abs=0.01)
    assert found[-1] == pytest.approx(0.45, abs=0.002)


def test_friction_of_blocks_is_that_of_the_pad(recording: Recording, columns: Columns, stops: Stops) -> None:
    lever = 2.0 * columns.brake.piston_area * columns.brake.effective_radius
    for block in (0, len(stops.mu) // 2, len(stops.mu) - 1):
        span = slice(stops.block_first[block], stops.block_first[block] + stops.per_block)
        torque, pressure = stops.torque[span], stops.pressure[span]
        expected, *_ = np.linalg.lstsq(lever * pressure[:, None], torque, rcond=None)
        assert stops.mu[block] == pytest.approx(expected[0], rel=1e-9)


def test_a_part_is_the_same_stops(stops: Stops) -> None:
    part = some(stops, np.array([5, 2]))
    for place, stop in enumerate((5, 2)):
        assert part.mu[part.block_stop == place] == pytest.approx(stops.mu[stops.block_stop == stop])
        first = slice(part.first[place], part.first[place + 1])
        assert part.pressure[first] == pytest.approx(
            stops.pressure[stops.first[stop] : stops.first[stop + 1]]
        )
    block = part.block_first[part.block_stop == 1][0] - part.first[1]
    assert block == stops.block_first[stops.block_stop == 2][0] - stops.first[2]


def test_a_stop_ends_where_the_disc_stands(recording: Recording, columns: Columns) -> None:
    """Pressure held at rest for a second, the torque what holds the disc: friction is that of the stop."""
    one = slice(0, int(np.flatnonzero(np.diff(recording.time) > 1.0)[0]))
    braked = Recording(*(column[one] for column in recording))
    rest = np.ones(200)
    held = Recording(
        braked.time[-1] + 0.005 * np.cumsum(rest),
        braked.pressure[-1] * rest,
        50.0 * rest,
        0.0 * rest,
        braked.temperature[-1] * rest,
    )
    assert find_stops(joined([braked, held]), columns, "x").mu == pytest.approx(
        find_stops(braked, columns, "x").mu
    )


def test_the_release_is_no_friction(recording: Recording, columns: Columns) -> None:
    """Torque that goes at once while the pressure takes 0.4 s to fall."""
    one = slice(0, int(np.flatnonzero(np.diff(recording.time) > 1.0)[0]))
    braked = Recording(*(column[one] for column in recording))
    falls = np.linspace(0.5, 0.0, 80)
    let_go = Recording(
        braked.time[-1] + 0.005 * np.arange(1, 81),
        braked.pressure[-1] * falls,
        0.0 * falls,
        braked.speed[-1] + 0.0 * falls,
        braked.temperature[-1] + 0.0 * falls,
    )
    assert find_stops(joined([braked, let_go]), columns, "x").mu.min() > 0.2


def test_stops_without_torque_are_left_out_and_named(recording: Recording, columns: Columns) -> None:
    begins = np.flatnonzero(np.diff(recording.time, prepend=-100.0) > 1.0)
    dead = (recording.time >= recording.time[begins[3]]) & (recording.time < recording.time[begins[4]])
    found = find_stops(recording._replace(torque=np.where(dead, 0.0, recording.torque)), columns, "x")
    assert len(found) == 23
    assert found.mu.min() > 0.2
    assert found.dead == pytest.approx([recording.time[begins[3]]], abs=0.5)
