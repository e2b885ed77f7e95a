"""What an entry hears: names of the contract, NaN, read-only."""

import numpy as np
import pytest

from brakelab.studies.entries.inputs import Inputs
from ecu.contract.signals import INPUT, INPUT_SIGNALS, N_INPUTS


def inputs() -> Inputs:
    values = np.arange(N_INPUTS, dtype=np.float64)
    values[INPUT["accel_x"]] = np.nan
    values.setflags(write=False)
    return Inputs(values, 0.0, 0.01, frozenset(INPUT))


def test_every_signal_of_the_contract_is_heard_by_its_name() -> None:
    heard = inputs()
    for signal in INPUT_SIGNALS:
        stem, _, corner = signal.name.rpartition("_")
        if corner in ("fl", "fr", "rl", "rr"):
            value = getattr(heard, stem)[("fl", "fr", "rl", "rr").index(corner)]
        else:
            value = getattr(heard, signal.name)
        np.testing.assert_equal(value, np.nan if signal.name == "accel_x" else INPUT[signal.name])


def test_samples_cannot_be_changed_for_the_next_entry() -> None:
    with pytest.raises(ValueError, match="read-only"):
        inputs().wheel_speed[0] = 1.0


def test_a_misspelt_signal_is_reported() -> None:
    with pytest.raises(AttributeError, match="calliper_pressure"):
        _ = inputs().caliper_pressure
