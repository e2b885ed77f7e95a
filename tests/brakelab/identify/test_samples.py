"""Samples that stand alone, gaps, a time that begins anew."""

import numpy as np
import pytest

from brakelab.identify.samples import APART, alone, bridged, continued

RANDOM = np.random.default_rng(3)
SIGNALS = {
    "noise": RANDOM.normal(size=100_000),
    "little noise": RANDOM.normal(size=60),
    "applications": np.where(np.arange(5000) % 500 < 5, 60.0, 0.0) + RANDOM.normal(size=5000),
    "ramps": 800.0 * np.clip(np.sin(np.arange(3000) / 3.0), 0.0, 1.0),
    "nothing": np.zeros(100),
    "steps of a counter": np.floor(np.arange(2000) / 100.0),
}


@pytest.mark.parametrize("signal", SIGNALS.values(), ids=SIGNALS)
def test_a_signal_has_none_that_stand_alone_until_one_is_mistyped(signal: np.ndarray) -> None:
    assert not alone(signal).any()
    spoilt = signal.copy()
    spoilt[40] += 5.0 * (np.ptp(signal) + 1.0)
    spoilt[50] = np.nan
    assert np.flatnonzero(alone(spoilt)).tolist() == [40]


def test_short_gaps_are_bridged_long_ones_stay() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0, 5.0, 5.1, 9.0, 9.1])
    nan = np.nan
    values = np.array([nan, 1.0, nan, 3.0, nan, nan, nan, 8.0, nan, 9.0, nan, nan])
    found = bridged(t, values, 0.5)
    assert found[:4] == pytest.approx([1.0, 1.0, 2.0, 3.0])  # before the first one of a stop: held
    assert np.isnan(found[4:7]).all()
    assert found[7:10] == pytest.approx([8.0, 9.0, 9.0])
    assert np.isnan(found[10:]).all()
    assert np.isnan(bridged(t, np.full(12, nan), 0.5)).all()


def test_a_time_that_begins_anew_goes_on() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.0, 0.1, 0.2])
    assert continued(time) == pytest.approx([0.0, 0.1, 0.2, APART + 0.2, APART + 0.3, APART + 0.4])
    assert continued(time[:2]) == pytest.approx(time[:2])
