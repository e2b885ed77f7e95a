"""The pad of the simulated dynamometer: what section 3.3 says of pads, and that no law under test is it."""

import numpy as np
import pytest

from brakelab.identify.friction.dynamometer import Bench, Noise, new_bench
from brakelab.identify.friction.patches import MEDIANS, bedded, draw_pad, rub
from brakelab.plant.dynamometer import DECELERATION, PRESSURE, mean_friction, new_stop
from brakelab.plant.linings import Lining

KMH = 1.0 / 3.6


def still(lining: Lining, brake: str) -> Bench:
    """Return a pad of median numbers without chance."""
    bench = new_bench(lining, brake, 0)
    assert bench.pad is not None
    bench.pad[0] = MEDIANS[brake]
    bench.pad["scatter"] = bench.pad["ripple"] = 0.0
    return bench


def braked(bench: Bench, temperature: float, bar: float = 30.0, speed: float = 80.0) -> float:
    stop = new_stop(PRESSURE, speed * KMH, 30.0 * KMH, temperature, pressure=bar * 1e5)
    return mean_friction(bench.run(stop))


@pytest.mark.parametrize("brake", ["A", "B", "C"])
@pytest.mark.parametrize(
    ("what", "low", "high"),
    [
        ("grows with temperature, 60 to 160 degC", (60.0, 30.0), (160.0, 30.0)),
        ("grows with pressure, 10 to 60 bar", (100.0, 10.0), (100.0, 60.0)),
    ],
)
def test_friction(
    lining: Lining, brake: str, what: str, low: tuple[float, float], high: tuple[float, float]
) -> None:
    before, after = (braked(still(lining, brake), *case) for case in (low, high))
    print(what, before, after)
    assert after > 1.01 * before


def test_hot_stops_of_c_fade(lining: Lining) -> None:
    """Table 3.4: C loses a third between 100 and 300 degC at 1 g."""
    means = []
    for temperature in (100.0, 300.0):
        stop = new_stop(DECELERATION, 100.0 * KMH, 5.0 * KMH, temperature, deceleration=9.81)
        means.append(mean_friction(still(lining, "C").run(stop)))
    assert means[1] < 0.85 * means[0]


def test_a_stop_remembers_the_one_before(lining: Lining) -> None:
    """The same stop after a hot one and after a cold one: plateaus are kept by half."""
    means = []
    for before in (50.0, 220.0):
        bench = still(lining, "A")
        braked(bench, before)
        means.append(braked(bench, 100.0))
    assert means[1] > 1.005 * means[0]


def test_plateaus_settle_where_births_equal_deaths() -> None:
    pad, state = draw_pad("A", np.random.default_rng(0)), bedded(20.0)
    pad["ripple"] = 0.0
    pad["flash"] = 0.0
    random = np.random.default_rng(0)
    state["contact_temperature"] = 100.0
    for _ in range(20_000):
        rub(pad[0], state[0], 30e5, 5.0, 100.0, 1e-3, random)
    births = pad["birth"] * np.exp(-pad["activation"] * (1 / 373.15 - 1 / 373.15))
    burnt = 1.0 / (1.0 + np.exp(-(100.0 - pad["fade_at"]) / 40.0))
    deaths = 1.0 + pad["wear"] * 15e6 / 30e6 + 3.0 * burnt
    assert state["plateaus"] == pytest.approx(births / (births + deaths), rel=1e-3)


def test_pads_of_a_make_differ_and_a_seed_repeats(lining: Lining) -> None:
    first, same, other = (braked(new_bench(lining, "A", seed), 100.0) for seed in (1, 1, 2))
    assert first == same != other


def test_sensors_are_off_by_what_they_are_said_to(lining: Lining) -> None:
    bench = new_bench(lining, "A", 3, Noise(thermocouple=0.0))
    trace = bench.run(new_stop(PRESSURE, 30.0, 8.0, 100.0, pressure=30e5))
    seen = bench.sense(trace, 0.0)
    true = trace[::5]
    assert np.std(seen.torque - bench.torque_gain * true["torque"]) == pytest.approx(6.0, rel=0.1)
    assert np.std(seen.temperature - true["temperature"]) == pytest.approx(0.5, rel=0.1)
    assert np.diff(seen.time) == pytest.approx(1.0 / 200.0)
