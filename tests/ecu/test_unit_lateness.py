"""The line that tells of hydraulics which are not CONFIG's."""

import math
from pathlib import Path

import numpy as np
import pytest

from ecu.contract.records import OUTPUTS
from ecu.settings.config import load_config, new_params
from ecu.unit_lateness import lateness_line

REMEDY = "correct dead times and lags of [hydraulics]"
SUV = Path(__file__).parents[2] / "config" / "suv.toml"


@pytest.mark.parametrize(
    ("rise", "fall", "line"),
    [
        (math.nan, math.nan, ""),
        (0.070, 0.050, ""),
        (0.126, math.nan, "pressures rise 126 ms after their demands (CONFIG: 63 ms): "),
        (
            *(0.030, 0.120),
            "pressures rise 30 ms after their demands (CONFIG: 63 ms) and fall 120 ms after their demands "
            "(CONFIG: 60 ms): ",
        ),
    ],
)
def test_what_is_said_of_the_hydraulics(rise: float, fall: float, line: str) -> None:
    outputs = np.zeros(1, OUTPUTS)[0]
    outputs["pressure_lateness_rise"], outputs["pressure_lateness_fall"] = rise, fall
    assert lateness_line(new_params(load_config(SUV))[0], outputs) == line + (line and REMEDY)
