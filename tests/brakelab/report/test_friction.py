"""Friction against temperature, speed and pressure: only what was observed, and its means."""

import numpy as np
import pytest

from brakelab.report.drive import DriveResult
from brakelab.report.friction import plots_of_friction
from ecu.contract.signals import CORNERS, HOLDING, OBSERVING

from .conftest import braking_between

T = np.arange(0.0, 20.0, 0.01)
STOP = braking_between(5.0, 15.0)


def drive(observed: tuple[float, float]) -> DriveResult:
    """Friction falls by 0.001 per degree, discs warm from 100 to 300 °C in the stop from 5 to 15 s."""
    disc = 100.0 + 20.0 * np.clip(T - 5.0, 0.0, 10.0)
    columns = {"vehicle_speed": 30.0 - 3.0 * np.clip(T - 5.0, 0.0, 10.0)}
    for corner in CORNERS:
        columns[f"mu_b_{corner}"] = 0.5 - 0.001 * (disc - 100.0)
        columns[f"sigma_mu_b_{corner}"] = np.full_like(T, 0.02)
        columns[f"disc_temperature_{corner}"] = disc
        inside = (observed[0] <= T) & (observed[1] > T)
        columns[f"mode_{corner}"] = np.where(inside, OBSERVING, HOLDING).astype(float)
    return DriveResult(T, columns, {})


def lines(plot: object) -> list[dict[str, np.ndarray]]:
    return [
        {name: np.asarray(values) for name, values in glyph.data_source.data.items()}
        for glyph in plot.renderers  # type: ignore[attr-defined]
        if type(glyph.glyph).__name__ == "Line"
    ]


def test_means_follow_what_was_observed() -> None:
    plots = plots_of_friction(drive((7.0, 12.0)), drive((0.0, 20.0)), [STOP])
    assert set(plots) == {
        f"{of}-{axle}" for of in ("disc_temperature", "vehicle_speed") for axle in ("front", "rear")
    }
    low, high, mean, true = lines(plots["disc_temperature-front"])
    np.testing.assert_allclose(high["y"] - low["y"], 4.0 * 0.02, atol=1e-9)
    assert mean["x"].min() > 140.0
    assert mean["x"].max() < 240.0
    for line in (mean, true):
        np.testing.assert_allclose(line["y"], 0.5 - 0.001 * (line["x"] - 100.0), atol=1e-9)
    *_, speed = lines(plots_of_friction(drive((7.0, 12.0)), None, [STOP])["vehicle_speed-rear"])
    assert speed["x"].max() == pytest.approx(24.0 * 3.6, rel=0.05)


def test_nothing_observed_draws_nothing() -> None:
    assert plots_of_friction(drive((16.0, 18.0)), None, [STOP]) == {}
    assert plots_of_friction(drive((7.0, 12.0)), None, []) == {}
