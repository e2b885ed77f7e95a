"""What a rest leaves of the heat in the discs, and clocks that tell nothing."""

import math
from datetime import UTC, datetime
from pathlib import Path

import pytest

from ecu.algorithm.step import new_state
from ecu.recording.rest import STAMP, cool_discs, rest_of
from ecu.settings.config import load_config, new_params

NOW = datetime(2026, 3, 1, 12, 0, 0, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("saved_at", "rest"),
    [
        ("2026-03-01T11:59:00Z", 60.0),
        ("2026-02-28T12:00:00Z", 86_400.0),
        ("2026-03-01T12:00:01Z", 0.0),  # the clock was set back
        ("1970-01-01T00:10:00Z", 0.0),  # it was never set
        ("yesterday", 0.0),
        ("", 0.0),
    ],
)
def test_the_rest_is_what_the_clock_has_gone_on(saved_at, rest) -> None:
    assert rest_of(saved_at, NOW) == rest


def test_the_stamp_is_that_of_the_store(tmp_path) -> None:
    assert datetime.strptime(datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), STAMP)


@pytest.mark.parametrize("rest", [0.0, 600.0, 36_000.0])
def test_the_greatest_excess_decays_at_half_the_rate_of_a_car_at_rest(rest) -> None:
    params = new_params(load_config(Path(__file__).parents[3] / "config" / "suv.toml"))
    learned = new_state(params)["learned"].copy()
    learned["disc_excess"] = 200.0
    cool_discs(learned, params, rest)
    for i, rate in ((0, 1.792e-3), (2, 1.547e-3)):
        assert learned[0]["disc_excess"][i] == pytest.approx(200.0 * math.exp(-0.5 * rate * rest))
