"""The bench of the loop's margins: loops whose answer is known in closed form, and one point of the real
one."""

import numpy as np
import pytest

from brakelab.studies.control import margins
from brakelab.studies.control.margins import FREQUENCIES, Margins, in_phase, margin_tables
from ecu.settings.config import load_config
from ecu.settings.resources import resource


@pytest.mark.parametrize("gain", [0.02, 0.5])
@pytest.mark.parametrize("phase", [-2.0, 0.0, 1.0])
def test_amplitude_and_phase_are_found_beside_a_drift(gain: float, phase: float) -> None:
    t = 3.0 + 0.01 * np.arange(1000)
    y = gain * np.sin(2 * np.pi * 0.7 * t + phase) + 0.3 + 0.05 * t
    assert in_phase(t, y, 0.7) == pytest.approx(gain * np.exp(1j * phase), abs=1e-9)


@pytest.mark.parametrize(
    ("eigenvalue", "largest", "phase", "distance"),
    [(0.5, 0.5, np.inf, 0.5), (-0.5, 0.5, np.inf, 1.5), (1.2j, 1.2, 90.0, np.hypot(1.0, 1.2))],
)
def test_margins_of_a_loop_that_is_a_number(eigenvalue, largest, phase, distance) -> None:
    values = np.zeros((len(FREQUENCIES), 2), np.complex128)
    values[3, 0] = eigenvalue
    loop = np.zeros((len(FREQUENCIES), 2, 2), np.complex128)
    car = Margins(loop, values)
    assert (car.largest, car.phase_margin) == pytest.approx((largest, phase))
    assert car.distance == pytest.approx(min(distance, 1.0))  # the other eigenvalues are 0
    assert car.at_hz == FREQUENCIES[3]
    worst = dict(zip(*(lambda t: (t.columns, t.rows[-1]))(margin_tables([car])[0]), strict=True))
    assert float(worst["gain margin [dB]"]) == pytest.approx(-20 * np.log10(largest), abs=0.5)


def test_the_shipped_loop_is_far_from_unstable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(margins, "FREQUENCIES", (1.0, 4.5))
    car = margins.margins_of(load_config(resource("config/suv.toml")), 0)
    print(f"largest loop gain {car.largest:.3f}")
    assert 0.01 < car.largest < 0.5
    assert np.isinf(car.phase_margin)
