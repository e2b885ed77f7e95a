import numpy as np
import pytest

from ecu.contract.faults import IMU_LOST
from ecu.recording.ring import RingReader
from ecu.watch.history import COLUMN, EVERY, KEPT_S, LATENESS_US, History


def read(loop, history, reader=None):
    reader = reader or RingReader(loop.ring.path)
    while len((batch := reader.read()).records):
        history.take(batch, reader)
    return reader


def test_a_row_is_the_last_of_four_cycles_with_their_worst_lateness(loop):
    one, history = loop(), History()
    for number in range(12):
        one.publish(1, lateness_us=700.0 if number == 5 else 30.0, vehicle_speed=float(number))
    read(one, history)
    assert [row[COLUMN["vehicle_speed"]] for row in history.rows] == [3.0, 7.0, 11.0]
    assert [row[COLUMN["lateness"]] for row in history.rows] == [30.0, 700.0, 30.0]
    assert np.diff([row[COLUMN["t"]] for row in history.rows]).round(6).tolist() == [0.04, 0.04]


def test_the_worst_lateness_is_not_lost_between_two_reads(loop):
    one, history = loop(), History()
    reader = RingReader(one.ring.path)
    one.publish(2, lateness_us=900.0)
    read(one, history, reader)
    one.publish(EVERY - 2)
    read(one, history, reader)
    assert history.rows[-1][COLUMN["lateness"]] == 900.0


def test_lateness_by_its_edges(loop):
    one, history = loop(), History()
    for lateness_us, count in ((20.0, 3), (20.001, 2), (99.0, 1), (10_001.0, 4)):
        one.publish(count, lateness_us=lateness_us)
    read(one, history)
    counts = dict(zip([*LATENESS_US, "later"], history.lateness.tolist(), strict=True))
    assert counts == {**dict.fromkeys(LATENESS_US, 0), 20: 3, 50: 2, 100: 1, "later": 4}


def test_corners_are_in_the_contract_s_order(loop):
    one, history = loop(), History()
    one.publish(4, mu_b=[0.1, 0.2, 0.3, 0.4], disc_temperature=[1, 2, 3, np.nan])
    read(one, history)
    row = history.rows[-1]
    assert [row[COLUMN[f"mu_b_{corner}"]] for corner in ("fl", "fr", "rl", "rr")] == [0.1, 0.2, 0.3, 0.4]
    assert np.isnan(row[COLUMN["disc_temperature_rr"]])


def test_events_are_those_of_the_daemon_s_log(loop):
    one, history = loop(), History()
    reader = RingReader(one.ring.path)
    one.publish(4, mode=2, active_faults=0)
    read(one, history, reader)
    assert not history.events  # what was so before it was watched is no event
    one.publish(4, mode=3, active_faults=IMU_LOST)
    read(one, history, reader)
    assert [(event.text, event.serious) for event in history.events] == [
        ("active → degraded", False),
        ("IMU lost: check the sender of Imu", True),
    ]
    assert history.events[0].clock == pytest.approx(1_800_000_000.07)


def test_events_of_the_past_have_the_time_of_their_cycles(loop):
    """A ring holds 24 s: what changed in them is read in an instant, a second at a time."""
    one, history = loop(), History()
    for mode in (1, 2, 1, 2, 1):
        one.publish(150, mode=mode)
    reader = RingReader(one.ring.path)
    while len((batch := reader.read(100)).records):
        history.take(batch, reader)
    clocks = [event.clock - 1_800_000_000.0 for event in history.events]
    assert clocks == pytest.approx([1.5, 3.0, 4.5, 6.0])


def test_what_was_lost_before_it_was_attached_is_no_event(loop):
    one, history = loop(), History()
    reader = RingReader(one.ring.path)
    one.publish(2401)  # one more than the ring holds
    read(one, history, reader)
    assert not history.events
    one.publish(2403, frames=1)
    read(one, history, reader)
    assert [event.text for event in history.events] == [
        "this watcher was too slow: 4 cycles and 0 frames not seen in all"
    ]


def test_old_cycles_are_forgotten_whole_batches_at_a_time(loop):
    one, history = loop(), History()
    reader = RingReader(one.ring.path)
    for _ in range(16):
        one.publish(2000)
        read(one, history, reader)
    assert KEPT_S <= history.kept_s <= KEPT_S + 2.56
    assert history.kept_s == sum(len(batch.records) for batch in history.batches) / 100
    assert (history.cycles, history.missed) == (32_000, 0)
    history.begin_run()
    assert history.kept_s == 0
    assert len(history.rows) > 0
