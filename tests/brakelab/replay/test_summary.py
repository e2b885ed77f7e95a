"""What `replay` prints of the brakings."""

import pytest
from rich.console import Console

from brakelab.replay.summary import WIDTH, brakings_table, listed, prediction_lines
from brakelab.results.brakes import LEARNED, BrakeRow
from ecu.contract.signals import CORNERS

NOMINAL = (0.4, 0.4, 0.36, 0.36)


def row(number: int, corner: str, **known: object) -> BrakeRow:
    """A braking from 30 to 10 m/s in 4 s that taught; everything else is 0 but `known`."""
    about = {
        "t_start": 1.0,
        "duration": 4.0,
        "v_in": 30.0,
        "v_end": 10.0,
        "learning": LEARNED,
        "left_out": "",
    }
    numbers = dict.fromkeys(BrakeRow._fields, 0.0)
    return BrakeRow(**numbers | {"brake": number, "corner": corner} | about | known)


def printed(friction: tuple[float, float, float, float]) -> str:
    rows = [
        row(0, corner, mu_b_end=mu, sigma_mu_b_end=0.02) for corner, mu in zip(CORNERS, friction, strict=True)
    ]
    console = Console(width=150)
    with console.capture() as capture:
        console.print(brakings_table(rows, NOMINAL))
    return capture.get()


@pytest.mark.parametrize(
    ("friction", "front", "rear"),
    [
        ((0.40, 0.40, 0.36, 0.36), "0.400 ± 0.020 ", "0.360 ± 0.020 "),
        ((0.40, 0.40, 0.18, 0.18), "0.400 ± 0.020 ", "0.180 ± 0.020 at its bound"),
        ((0.60, 0.60, 0.19, 0.18), "0.600 ± 0.020 at its bound", "0.185 ± 0.020 at its bound"),
    ],
)
def test_friction_at_its_bound_is_marked(friction, front: str, rear: str) -> None:
    text = printed(friction)
    assert front in text
    assert rear in text
    assert text.count("at its bound") == (front + rear).count("at its bound")


def test_a_line_has_what_was_measured_predicted_and_configured() -> None:
    force = {
        "specific_force_mean": 4.0,
        "specific_force_predicted": 4.2,
        "sigma_specific_force": 0.1,
        "specific_force_configured": 4.6,
    }
    console = Console(width=150)
    with console.capture() as capture:
        console.print(brakings_table([row(0, corner, **force) for corner in CORNERS], NOMINAL))
    assert "108 → 36 4.00 4.20 ± 0.10 4.60" in " ".join(capture.get().split())


@pytest.mark.parametrize(
    ("brakings", "every", "shown", "before"),
    [(0, False, 0, 0), (3, False, 3, 0), (40, False, 40, 0), (1024, False, 40, 984), (1024, True, 1024, 0)],
)
def test_a_long_drive_lists_its_last_brakings(brakings: int, every: bool, shown: int, before: int) -> None:
    taps = [row(-1, corner, duration=0.4) for corner in CORNERS]
    rows = [row(number, corner) for number in range(brakings) for corner in CORNERS]
    found, left = listed([*taps, *rows, *taps], every)
    assert (len(found), left) == (4 * shown, before)
    assert [one.brake for one in found[-4:]] == [brakings - 1] * min(4 * shown, 4)


def test_nothing_is_cut_on_a_narrow_terminal() -> None:
    console = Console(width=80)
    with console.capture() as capture:
        console.print(brakings_table([row(0, corner) for corner in CORNERS], NOMINAL))
    text = capture.get()
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80


def test_a_braking_is_one_line_off_a_terminal() -> None:
    friction = {"mu_b_end": 0.4, "sigma_mu_b_end": 0.02, "learning": "held: ABS, ESP, accelerator or reverse"}
    console = Console(width=WIDTH)
    with console.capture() as capture:
        console.print(brakings_table([row(0, corner, **friction) for corner in CORNERS], NOMINAL))
    assert len([line for line in capture.get().splitlines() if "0.400" in line or "reverse" in line]) == 1


def lines_of(*brakings: tuple[float, float, float, str]) -> list[str]:
    """Lines for brakings of measured, predicted and configured specific force, and why they are left out."""
    rows = [
        row(
            number,
            corner,
            specific_force_mean=measured,
            specific_force_predicted=predicted,
            specific_force_configured=configured,
            left_out=why,
        )
        for number, (measured, predicted, configured, why) in enumerate(brakings)
        for corner in CORNERS
    ]
    return prediction_lines(rows)


NONE = "prediction: no braking to judge it by"


@pytest.mark.parametrize(
    ("brakings", "lines"),
    [
        pytest.param([], [NONE], id="none"),
        pytest.param(
            [(4.0, 4.2, 4.4, "")],
            [
                "prediction of 1 braking: off by 5.0 %, bias +5.0 %",
                "beside it: configured friction 10.0 %, running average 10.0 %, one scale in hindsight 0.0 %",
            ],
            id="one",
        ),
        # Linings give 1 / 1.1 and 1 / 1.25 of what is configured: the running average takes 1, then 0.95455.
        pytest.param(
            [(2.0, 2.2, 2.2, ""), (4.0, 3.8, 5.0, ""), (0.1, 9.0, 9.0, "below 0.5 m/s²"), (2, 9, 9, "x")],
            [
                "prediction of 2 brakings: off by 7.5 % on the mean, 7.5 % in the median, 10.0 % at worst, "
                "bias +2.5 %",
                "beside it, on the mean: configured friction 17.5 %, running average 14.7 %, "
                "one scale in hindsight 6.0 %",
                "left out of the prediction: 1 below 0.5 m/s², 1 x",
            ],
            id="two that count, two that do not",
        ),
        pytest.param(
            [(0.1, 9.0, 9.0, "below 0.5 m/s²")],
            [NONE, "left out of the prediction: 1 below 0.5 m/s²"],
            id="one that does not count",
        ),
    ],
)
def test_what_the_lines_say_of_the_prediction(brakings, lines: list[str]) -> None:
    assert lines_of(*brakings) == lines
