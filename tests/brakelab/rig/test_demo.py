"""Lines of the demonstration on its brakings."""

from types import SimpleNamespace
from typing import Any

import pytest

from brakelab.rig.demo import Brakings
from ecu.contract.records import OUTPUTS, new_record


def records(braking: list[int]) -> Any:
    """Return a ring that holds cycles with these flags, from 20 m/s at 3 m/s²."""
    found = []
    for k, flag in enumerate(braking):
        outputs = new_record(OUTPUTS)[0]
        outputs["braking"], outputs["vehicle_speed"] = flag, 20.0 - 0.03 * k
        outputs["decel_demand_total"], outputs["accel_x_road"] = 3.0, -3.0
        found.append({"cycle": {"t_mono_ns": 10_000_000 * k}, "outputs": outputs})
    return SimpleNamespace(read=lambda: SimpleNamespace(records=found))


@pytest.mark.parametrize(
    ("braking", "before_the_end", "in_all"),
    [
        pytest.param([0] * 5, 0, 0, id="none"),
        pytest.param([0] * 5 + [1] * 50 + [0], 1, 1, id="released"),
        pytest.param([1] * 50 + [0] + [1] * 50, 1, 2, id="the last one lasts"),
    ],
)
def test_every_braking_is_reported_once(
    braking: list[int], before_the_end: int, in_all: int, capsys: pytest.CaptureFixture[str]
) -> None:
    brakings = Brakings()
    brakings.look(records(braking))
    said = capsys.readouterr().out
    assert said.count("asked 3.00") == before_the_end
    brakings.end()
    brakings.end()
    said += capsys.readouterr().out
    assert said.count("asked 3.00") == in_all
    assert ("braking 2" in said) is (in_all == 2)
