"""Answers from a data sheet: units, ranges, sizes of tyres; a wrong answer is reported with the remedy."""

import pytest

from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.data_sheet import BY_KEY, QUESTIONS, Question, default, needed, parse_answer, tyre_radius
from ecu.settings.resources import resource


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("vehicle.wheelbase", "2665", 2665.0),
        ("vehicle.wheelbase", "2.665 m", 2665.0),
        ("vehicle.wheelbase", "2,665m", 2665.0),
        ("vehicle.mass", "1.62 t", 1620.0),
        ("vehicle.mass", "3571 lb", 1619.8),
        ("vehicle.front_load", "9.22e3 N", 939.9),
        ("vehicle.frontal_area", "2.3 m²", 2.3),
        ("front.mu_nominal", "42 %", 0.42),
        ("front.piston_diameter", "57", 57.0),
        # as much area as two of 38 and 42: (38² + 42²) / 2 = 1604
        ("front.piston_diameter", "38+42", 1604.0**0.5),
        ("front.calliper", "fix", "fixed"),
        ("motors", "both", "both"),
        ("front.tyre", "235/55 R19", "235/55 R19"),
    ],
)
def test_an_answer_is_read_in_its_unit(key: str, text: str, value: object) -> None:
    answer = parse_answer(BY_KEY[key], text, "--set")
    assert answer == (pytest.approx(value, abs=0.1) if isinstance(value, float) else value)


@pytest.mark.parametrize(
    ("key", "text", "says"),
    [
        (
            "vehicle.wheelbase",
            "2.665",
            "give a value from 1500 to 6000 mm (found '2.665'); did you mean 2.665 m?",
        ),
        ("front.piston_diameter", "0.057", "did you mean 0.057 m?"),
        ("vehicle.mass", "nan", "give a number in kg, t, lb, N (found 'nan')"),
        ("vehicle.mass", "1620 mm", "give a number in kg"),
        ("vehicle.mass", "", "give a number in kg"),
        ("vehicle.mass", "1.6.2", "give a number in kg"),
        ("front.pistons", "1.5", "give a whole number"),
        ("front.calliper", "drum", "one of floating, fixed (found 'drum')"),
        ("front.calliper", "f", "one of floating, fixed (found 'f')"),
        ("front.tyre", "19 inch", "235/55 R19 (found '19 inch')"),
        ("name", 'a "b"', "give a word"),
    ],
)
def test_a_wrong_answer_is_reported_with_what_would_be_right(key: str, text: str, says: str) -> None:
    with pytest.raises(UserError) as error:
        parse_answer(BY_KEY[key], text, "--set")
    assert str(error.value).startswith(f"--set: {key}: ")
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("size", "radius"),
    # ETRTO's overall diameters: 235/55 R19 742, 205/55 R16 632, 315/70 R22.5 1014 mm
    [("235/55 R19", 0.371), ("205/55R16 91V", 0.316), ("P255/40 ZR19", 0.3433), ("315/70 R22.5", 0.507)],
)
def test_a_tyre_has_the_radius_of_the_tables(size: str, radius: float) -> None:
    assert tyre_radius(size, "", "") == pytest.approx(radius, abs=0.001)


def test_one_of_two_alternatives_is_enough() -> None:
    every = {question.key: 1.0 for question in QUESTIONS}
    for key in ("vehicle.front_load", "vehicle.front_axle", "rear.effective_radius", "rear.disc_diameter"):
        assert needed({name: one for name, one in every.items() if name != key}) == []
    without = {"rear.effective_radius", "rear.disc_diameter"}
    found = needed({name: one for name, one in every.items() if name not in without})
    assert [question.key for question in found] == ["rear.disc_diameter"]


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.key)
@pytest.mark.parametrize("car", ["suv", "sedan", "lcv"])
def test_what_stands_in_is_itself_an_answer(question: Question, car: str) -> None:
    usual = default(question.key, {}, load_config(resource(f"config/{car}.toml")))
    if usual is not None:
        text = usual if isinstance(usual, str) else f"{usual:g}"
        expected = usual if isinstance(usual, str) else pytest.approx(usual, rel=1e-4)
        assert parse_answer(question, text, "") == expected
