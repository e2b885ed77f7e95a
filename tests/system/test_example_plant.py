"""The car of examples/plant.py, as a user starts it, is braked to a standstill."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

from .conftest import PATIENCE_S, ROOT

pytestmark = pytest.mark.multicast

GROUP = f"239.83.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
BUS = ("udp_multicast", GROUP)


def test_the_example_is_braked_as_it_asks(daemon):
    unit = daemon("--config", ROOT / "config" / "suv.toml", "-i", BUS[0], "-c", BUS[1], "--armed")
    unit.wait_for("ready")
    example = [sys.executable, str(ROOT / "examples" / "plant.py"), *BUS]
    said = subprocess.run(example, capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout
    assert unit.end() == 0
    rows = [[float(number) for number in re.findall(r"-?\d+\.\d+", line)] for line in said.splitlines()]
    _, speed, _, bar = rows[-1]
    assert speed == 0.0
    assert bar > 5.0
    braking = [decel for t, _, decel, _ in rows if t >= 3.0]
    assert np.median(braking) == pytest.approx(4.4, abs=0.8), (
        said
    )  # asks for 4 m/s²; a busy machine holds it up
    assert max(braking) < 6.0, said
