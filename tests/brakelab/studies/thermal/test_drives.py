"""Simulated drives with thermocouples: beyond the town, through files, and not kinder than the world."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.studies.thermal.drives import LAG, measured_trip, thermocouples, write_drives


def test_thermocouples_lag_scatter_and_are_off() -> None:
    true = np.repeat([[20.0] * 4, [220.0] * 4], 300, axis=0)
    found = thermocouples(true, 60_000, np.random.default_rng(1))
    shown = found[::10]
    assert np.isnan(found[1:10]).all()
    late = shown[5000:].mean(axis=0)
    assert np.abs(late - 220.0).max() < 10.0
    assert np.ptp(late) > 0.5
    reached = np.argmax(shown > 20.0 + 0.63 * 200.0, axis=0) * 0.1
    assert ((reached > 300.0 + 0.3 * LAG[0]) & (reached < 302.0 + 1.5 * LAG[1])).all()
    assert (shown[:2900].std(axis=0) > 0.4).all()


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_a_trip_begins_at_a_stop(share) -> None:
    trip = measured_trip(3, "usual", 8.0, 1.0, share)
    assert trip.trace is not None
    speeds = np.array(trip.trace.speed)
    assert tuple(speeds[0]) == (0.0, 0.0)
    assert (speeds[-1, 0] < 5000.0) == bool(share)
    assert trip.initial_disc_temperature == (8.0, 8.0)
    assert trip.wetness == 1.0
    assert trip.grade[0][0] == 0.0


def test_written_drives_have_inputs_and_temperatures(tmp_path) -> None:
    paths = write_drives(tmp_path, 2, seconds=40.0)
    assert [path.name for path in paths] == ["dry.parquet", "rain.parquet"]
    for path, rain in zip(paths, (0.0, 1.0), strict=True):
        table = pq.read_table(path)
        assert table.num_rows == 4000
        assert table["disc_temperature_measured_rr"].null_count == 3600
        assert set(table["rain"].drop_null().to_pylist()) == {rain}
        assert "calliper_pressure_fl" in table.column_names
