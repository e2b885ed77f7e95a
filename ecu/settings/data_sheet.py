"""Questions of `config new`: figures of a data sheet with their units and limits.

Lengths are asked in mm and masses in kg, as data sheets have them; an answer may bring its own unit. What a
data sheet does not have (tyre stiffness, inertias, sensors) is taken from the nearest shipped car.
"""

import math
import re
from collections.abc import Mapping
from typing import Final, NamedTuple

from ecu.contract.params import GRAVITY
from ecu.errors import UserError
from ecu.settings.sections import Axle, Config

UNITS: Final[dict[str, dict[str, float]]] = {
    "mm": {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4},
    "kg": {"kg": 1.0, "t": 1000.0, "lb": 0.45359237, "N": 1.0 / GRAVITY},
    "m^2": {"m^2": 1.0},
    "-": {"-": 1.0, "%": 0.01},
}
"""Units of answers, by the one that is asked for."""
HYDRAULIC, BY_WIRE = "hydraulic", "by-wire"
FIXED, FLOATING = "fixed", "floating"
MOTORS: Final = ("none", "front", "rear", "both")
_TYRE: Final = re.compile(r"(?:P|LT)?(\d{3})/(\d{2,3})\s*Z?R\s*F?\s*(\d{2}(?:\.5)?)C?\b.*", re.IGNORECASE)


class Question(NamedTuple):
    """One figure of the data sheet."""

    key: str
    text: str
    unit: str = ""
    """Of the answer, empty: a word."""
    low: float = -math.inf
    high: float = math.inf
    words: tuple[str, ...] = ()
    """Possible answers where it is a choice."""
    instead: str = ""
    """Key of the question that takes its place where it stays without an answer."""
    assumed: bool = False
    """The nearest shipped car's may stand in for it."""


def _of_axle(axle: str) -> tuple[Question, ...]:
    return (
        Question(f"{axle}.tyre", f"Tyre of the {axle} axle, as on its side (235/55 R19)"),
        Question(f"{axle}.calliper", f"Callipers of the {axle} axle", words=(FLOATING, FIXED)),
        Question(f"{axle}.pistons", f"Pistons of a {axle} calliper, both sides together", "-", 1, 12),
        Question(
            f"{axle}.piston_diameter", f"Diameter of a {axle} piston, several as 38+42+44", "mm", 15, 120
        ),
        Question(
            f"{axle}.effective_radius",
            f"Effective radius of the {axle} brake",
            "mm",
            50,
            250,
            instead=f"{axle}.disc_diameter",
        ),
        Question(f"{axle}.disc_diameter", f"Diameter of the {axle} disc", "mm", 180, 460),
        Question(f"{axle}.mu_nominal", f"Friction of the {axle} linings", "-", 0.15, 0.7, assumed=True),
    )


QUESTIONS: Final = (
    Question("name", "Name of the car", assumed=True),
    Question("vehicle.mass", "Mass as driven", "kg", 500, 7500),
    Question("vehicle.wheelbase", "Wheelbase", "mm", 1500, 6000),
    Question(
        "vehicle.front_load",
        "Load on the front axle as driven",
        "kg",
        150,
        5000,
        instead="vehicle.front_axle",
    ),
    Question("vehicle.front_axle", "Centre of gravity behind the front axle", "mm", 400, 4000),
    Question(
        "vehicle.cog_height", "Centre of gravity above the road, as driven", "mm", 300, 1500, assumed=True
    ),
    Question("vehicle.track", "Track, mean of both axles", "mm", 1000, 2500, assumed=True),
    Question("vehicle.drag_coefficient", "Drag coefficient", "-", 0.1, 1.2, assumed=True),
    Question("vehicle.frontal_area", "Frontal area", "m^2", 1, 8, assumed=True),
    Question("vehicle.laden_mass", "Greatest mass allowed", "kg", 500, 10000, assumed=True),
    Question("vehicle.laden_front_load", "Load on the front axle when laden", "kg", 150, 6000, assumed=True),
    *_of_axle("front"),
    *_of_axle("rear"),
    Question(
        "brakes",
        "Pressures: by-wire (each axle its own) or hydraulic (the same in all callipers)",
        words=(BY_WIRE, HYDRAULIC),
        assumed=True,
    ),
    Question("motors", "Axles whose electric motors may brake", words=MOTORS, assumed=True),
)
BY_KEY: Final = {question.key: question for question in QUESTIONS}

Answers = Mapping[str, str | float]


def parse_answer(question: Question, text: str, where: str) -> str | float:
    """Return an answer in the unit that was asked for; raises UserError that says what would be right."""
    text = text.strip()
    if question.key.endswith(".tyre"):
        tyre_radius(text, where, question.key)
        return text
    if question.words:
        found = [word for word in question.words if word.startswith(text.lower())] if text else []
        if len(found) != 1:
            remedy = f"one of {', '.join(question.words)} (found {text!r})"
            raise UserError(where, question.key, remedy)
        return found[0]
    if not question.unit:
        if not text or not text.isprintable() or '"' in text or "\\" in text:
            raise UserError(where, question.key, f"give a word (found {text!r})")
        return text
    if "+" in text and question.key.endswith(".piston_diameter"):
        sizes = [float(parse_answer(question, part, where)) for part in text.split("+")]
        return math.sqrt(sum(size**2 for size in sizes) / len(sizes))
    return _number(question, text, where)


def _number(question: Question, text: str, where: str) -> float:
    units = UNITS[question.unit]
    found = re.fullmatch(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*(\S*)", text)
    try:
        value = float(found[1].replace(",", ".")) if found else math.nan
    except ValueError:
        value = math.nan
    unit = (found[2] if found else "").replace("²", "^2") or question.unit
    if not math.isfinite(value) or unit not in units:
        remedy = f"give a number in {', '.join(units)} (found {text!r})"
        raise UserError(where, question.key, remedy)
    asked = value * units[unit]
    if question.low <= asked <= question.high:
        if question.key.endswith(".pistons") and asked != round(asked):
            raise UserError(where, question.key, f"give a whole number (found {text!r})")
        return asked
    fits = [name for name, scale in units.items() if question.low <= value * scale <= question.high]
    meant = f"; did you mean {value:g} {fits[0]}?" if fits else ""
    shown = "" if question.unit == "-" else f" {question.unit}"
    raise UserError(
        where,
        question.key,
        f"give a value from {question.low:g} to {question.high:g}{shown} (found {text!r}){meant}",
    )


def tyre_radius(size: str, where: str, key: str) -> float:
    """Return the unloaded radius [m] of a tyre: rim / 2 + width · aspect; raises UserError for no size."""
    found = _TYRE.fullmatch(size.strip())
    if not found:
        raise UserError(where, key, f"give the size as on the tyre's side: 235/55 R19 (found {size!r})")
    width, aspect, rim = (float(part) for part in found.groups())
    return 1e-3 * (0.5 * 25.4 * rim + width * 0.01 * aspect)


def needed(answers: Answers) -> list[Question]:
    """Return the questions without an answer for which nothing can stand in."""
    replaced = {q.instead: q for q in QUESTIONS if q.instead}
    return [
        question
        for question in QUESTIONS
        if not question.assumed
        and question.key not in answers
        and not question.instead
        and not (question.key in replaced and replaced[question.key].key in answers)
    ]


def default(key: str, answers: Answers, like: Config) -> str | float | None:
    """Return the default of an answer, in the unit asked for, from the car `like`; None: there is none."""
    section, _, name = key.rpartition(".")
    car = like.vehicle
    scale = float(answers.get("vehicle.wheelbase", 1000.0 * car.wheelbase)) / (1000.0 * car.wheelbase)
    mass = float(answers.get("vehicle.mass", car.mass)) / car.mass
    match name:
        case "front_load" | "effective_radius" | "tyre" | "laden_front_load":
            return None
        case "name":
            return "car" if key == "name" else None
        case "mass" | "wheelbase" | "cog_height" | "track":
            return getattr(car, name) * (1.0 if name == "mass" else 1000.0)
        case "front_axle":
            return 1000.0 * car.front_axle * scale
        case "drag_coefficient" | "frontal_area":
            return getattr(car, name)
        case "laden_mass":
            return round((car.laden_mass or car.mass) * mass, -1)
        case "calliper":
            return FLOATING
        case "brakes":
            return BY_WIRE
        case "motors":
            return MOTORS[0]
    axle = _axle(like, section)
    if name == "disc_diameter":
        return 1000.0 * (2.0 * axle.effective_radius + axle.piston_diameter)
    return getattr(axle, name) * (1000.0 if name == "piston_diameter" else 1.0)


def _axle(car: Config, name: str) -> Axle:
    return car.front if name == "front" else car.rear
