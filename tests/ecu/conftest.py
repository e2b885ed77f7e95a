"""A healthy car for the tests of the algorithm: the shipped SUV and inputs that all arrived in this cycle."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ecu.contract.records import INPUTS, RecordArray
from ecu.contract.signals import CORNERS, DISC_TEMPERATURE_MEASURED, INPUT, RATE_OK, USABLE
from ecu.settings.config import load_config, new_params

CONFIGS = Path(__file__).parents[2] / "config"


@pytest.fixture(scope="session")
def shipped_params() -> RecordArray:
    return new_params(load_config(CONFIGS / "suv.toml"))


@pytest.fixture
def params(shipped_params: RecordArray) -> RecordArray:
    """`PARAMS` of the shipped SUV, shape (1,), fresh for each test."""
    return shipped_params.copy()


@pytest.fixture
def feed() -> Callable[..., RecordArray]:
    """Write named inputs as samples of this cycle; a four-wheel name takes a number or four."""

    def write(inputs: RecordArray | None = None, **values: Any) -> RecordArray:
        if inputs is None:
            inputs = np.zeros(1, INPUTS)
            inputs["dt_ns"] = 10_000_000
            inputs["new"], inputs["verdict"] = 1, USABLE | RATE_OK
            inputs["verdict"][:, DISC_TEMPERATURE_MEASURED : DISC_TEMPERATURE_MEASURED + 4] = (
                0  # no thermocouple
            )
        for name, value in values.items():
            if name in INPUT:
                inputs[0]["value"][INPUT[name]] = value
            else:
                first = INPUT[f"{name}_{CORNERS[0]}"]
                inputs[0]["value"][first : first + 4] = value
        return inputs

    return write
