"""What the rig's page and terminal say of the car itself, once over all scenarios, and of expectations."""

from types import SimpleNamespace
from typing import Any

import pytest

from brakelab.rig.page import by_the_car, passed_text
from brakelab.rig.verdicts import Verdict

WEAK = "compensation at its limit: front linings 36 % below the configured friction"
STRONG = "demand limited: rear linings 39 % above the configured friction"


@pytest.mark.parametrize(
    ("of_linings", "lines"),
    [
        ({"stuck": [], "lost": []}, []),
        ({"stuck": [WEAK]}, [f"by the car, in stuck: {WEAK}"]),
        ({"stuck": [WEAK], "lost": [WEAK]}, [f"by the car, in stuck, lost: {WEAK}"]),
        ({name: [WEAK] for name in "abcd"} | {"e": []}, [f"by the car, in 4 of 5: {WEAK}"]),
        ({"a": [WEAK, STRONG]}, [f"by the car, in a: {WEAK}", f"by the car, in a: {STRONG}"]),
    ],
)
def test_a_thing_of_the_car_is_said_once(of_linings: dict[str, list[str]], lines: list[str]) -> None:
    outcomes: list[Any] = [
        SimpleNamespace(scenario=name, of_linings=reasons) for name, reasons in of_linings.items()
    ]
    assert by_the_car(outcomes) == lines


@pytest.mark.parametrize(
    ("passed", "text"),
    [([], "none"), ([True], "passed"), ([True, True], "passed"), ([True, False, False], "2 of 3 failed")],
)
def test_a_scenario_passed_if_all_that_it_expects_did(passed: list[bool], text: str) -> None:
    outcome: Any = SimpleNamespace(verdicts=[Verdict("", "", one) for one in passed])
    assert passed_text(outcome) == text
