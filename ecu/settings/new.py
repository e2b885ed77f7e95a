"""`brake-ecu config new`: a CONFIG file from a car's data sheet, every line with its origin.

Derived by statics and geometry:

    front_axle = wheelbase (1 - load on the front axle / mass)
    unloaded_radius = rim / 2 + width · aspect of the tyre's size
    pistons on one side = all of a floating calliper, half of a fixed one's
    effective_radius = (disc - piston) / 2, where it is not known: the piston's edge is at the disc's
"""

import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from pydantic import ValidationError

from ecu.errors import UserError
from ecu.output import argument, fault, give
from ecu.settings import data_sheet as sheet
from ecu.settings.check import figures
from ecu.settings.config import Config, load_config, new_params, violations
from ecu.settings.described import descriptions
from ecu.settings.resources import resource
from ecu.settings.sections import Axle, Control, Sensors, Vehicle
from ecu.settings.toml_file import Section, describe, toml_value, unit_of

CARS: Final = ("suv", "sedan", "lcv")
"""Shipped cars of a data sheet; the nearest gives the figures that the user leaves out."""
MOTOR_SHARE: Final = 0.7
"""Of the brake torque, where motors brake (thesis, section 5.7.2)."""
ASSUMED: Final = "assumed"

Given = dict[str, str | float]


class Value(NamedTuple):
    """Value of a key, in its unit, and where it is from."""

    value: Any
    origin: str


def new(given: list[str], out: Path | None) -> int:
    """Ask for the data sheet, or take it from `given` ("key=value" each), and write a CONFIG file.

    Returns 0, or 1 after a warning where ECE R13-H forbids the resulting car. Nothing is written over.

    Raises:
        UserError: an answer is wrong or missing, or the file exists.
    """
    _refuse_existing(out)
    answers, taken = (parse_given(given), set[str]()) if given else _ask()
    missing = sheet.needed(answers)
    if missing:
        raise UserError("config new", "", f"missing: {', '.join(map(_named, missing))}; give --set KEY=VALUE")
    like = nearest(answers)
    out = out or Path(f"{answers.get('name', 'car')}.toml")
    _refuse_existing(out)
    text = config_text(answers, like, taken)
    try:
        config = Config.model_validate(tomllib.loads(text))
    except ValidationError as error:
        raise describe(error, "config new", Config) from None
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, "utf-8")
    return _tell(out, config)


def _refuse_existing(out: Path | None) -> None:
    if out is not None and out.exists():
        raise UserError("--out", str(out), "exists; give another name")
    if out is not None and out.suffix != ".toml":
        raise UserError("--out", str(out), "a configuration is written as TOML; let the name end in .toml")


def _named(question: sheet.Question) -> str:
    name = f"{question.key} [{question.unit}]" if question.unit not in ("", "-") else question.key
    either = [_named(one) for one in sheet.QUESTIONS if one.instead == question.key]
    return " or ".join([*either, name])


def parse_given(given: list[str]) -> Given:
    """Return the answers of "key=value" texts; raises UserError for the first that is none."""
    answers: Given = {}
    for text in given:
        key, equals, value = text.partition("=")
        key = key.strip()
        if not equals or key not in sheet.BY_KEY:
            raise UserError("--set", text, f"give KEY=VALUE with a KEY of {', '.join(sheet.BY_KEY)}")
        answers[key] = sheet.parse_answer(sheet.BY_KEY[key], value, "--set")
    return answers


def _ask() -> tuple[Given, set[str]]:
    """Ask every question until standard input ends; Enter takes what stands in brackets.

    Returns the answers, and the keys of those that Enter took.
    """
    print("Enter takes what stands in [brackets]; a length is in mm unless it brings its unit: 2.72 m.")
    answers: Given = {}
    passed: set[str] = set()
    taken: set[str] = set()
    try:
        for question in sheet.QUESTIONS:
            while question.key not in answers and question.key not in passed:
                _ask_one(question, answers, passed, taken)
    except EOFError:
        print()
    return answers, taken


def _ask_one(question: sheet.Question, answers: Given, passed: set[str], taken: set[str]) -> None:
    stands_in = next((one.key for one in sheet.QUESTIONS if one.instead == question.key), None)
    if stands_in in answers:
        passed.add(question.key)
        return
    usual = sheet.default(question.key, answers, nearest(answers))
    unit = f", {question.unit}" if question.unit not in ("", "-") else ""
    choice = f" ({', '.join(question.words)})" if question.words else ""
    shown = "" if usual is None else f" [{usual if isinstance(usual, str) else f'{usual:g}'}]"
    if question.instead or question.key.endswith("laden_front_load"):
        shown = " [not known]"
    text = input(f"{question.text}{choice}{unit}{shown}: ").strip()
    if not text and shown:
        passed.add(question.key)
        if not question.assumed and not question.instead and usual is not None:
            answers[question.key] = usual
            taken.add(question.key)
        return
    try:
        answers[question.key] = sheet.parse_answer(question, text, "answer")
    except UserError as error:
        print(f"  {error.remedy}")


def nearest(answers: Given) -> Config:
    """Return the shipped car that is nearest by mass and wheelbase, the first where neither is known."""
    cars = [load_config(resource(f"config/{name}.toml")) for name in CARS]

    def distance(car: Config) -> float:
        of_car = {"vehicle.mass": car.vehicle.mass, "vehicle.wheelbase": 1000.0 * car.vehicle.wheelbase}
        return sum(abs(float(answers.get(key, usual)) / usual - 1.0) for key, usual in of_car.items())

    return min(cars, key=distance)


def config_text(answers: Given, like: Config, taken: Collection[str] = ()) -> str:
    """Return a CONFIG file of the answers and, where they are silent, of the car `like`.

    `taken`: keys of answers that are that car's too.

    Raises:
        UserError: the answers contradict each other.
    """
    vehicle = _vehicle(answers, like, taken)
    axles = {axle: _axle(axle, answers, like, taken) for axle in ("front", "rear")}
    name = answers.get("name", "car")
    lines = [
        f'# {name}, by `brake-ecu config new`. "data sheet": as given; "{ASSUMED}": measure it, or',
        "# identify it from a drive (`brake-ecu identify vehicle`). All keys: docs/reference-config.md.",
        "",
        f'name = "{name}"',
        "transmit = false  # true arms the ECU: its pressure demands are flagged valid",
        *_table("vehicle", vehicle, Vehicle),
    ]
    for axle, values in axles.items():
        lines += _table(axle, values, Axle)
    sensors = {key: Value(value, f"as {like.name}, {ASSUMED}") for key, value in like.sensors}
    lines += _table("sensors", sensors, Sensors)
    control = {
        key: Value(getattr(like.control, key), f"as {like.name}, {ASSUMED}")
        for key in ("pedal_position", "pedal_decel")
    }
    if answers.get("brakes") == sheet.HYDRAULIC:
        control["distribution"] = Value("fixed", "the same pressure in all callipers")
        share = round(_equal_pressure_share(axles), 3)
        control["front_share"] = Value(share, "of these brakes at nominal friction")
    lines += _table("control", control, Control)
    motors = answers.get("motors", sheet.MOTORS[0])
    if motors != sheet.MOTORS[0]:
        lines += ["", "[blending]  # share of the brake torque for the motors: 0 off, 1 all they can"]
        lines += [f"{axle} = {MOTOR_SHARE if motors in (axle, 'both') else 0.0}" for axle in axles]
    return "\n".join(lines) + "\n"


def _vehicle(answers: Given, like: Config, taken: Collection[str]) -> dict[str, Value]:
    car = like.vehicle
    values = {key: Value(value, f"as {like.name}, {ASSUMED}") for key, value in car if value is not None}
    for key, value in answers.items():
        section, _, name = key.rpartition(".")
        if section == "vehicle" and name in values:
            metres = sheet.BY_KEY[key].unit == "mm"
            values[name] = Value(float(value) / 1000.0 if metres else value, _origin(key, like, taken))
    mass, length = float(values["mass"].value), float(values["wheelbase"].value)
    if "vehicle.front_load" in answers:
        values["front_axle"] = _from_load(answers, "vehicle.front_load", mass, length)
    if "vehicle.laden_mass" not in answers:
        usual = sheet.default("vehicle.laden_mass", answers, like)
        values["laden_mass"] = Value(usual, f"in proportion to {like.name}, {ASSUMED}")
    if "vehicle.laden_front_load" in answers:
        laden = float(values["laden_mass"].value)
        values["laden_front_axle"] = _from_load(answers, "vehicle.laden_front_load", laden, length)
    else:
        back = ((car.laden_front_axle or car.front_axle) - car.front_axle) / car.wheelbase
        moved = min(values["front_axle"].value + back * length, 0.65 * length)
        values["laden_front_axle"] = Value(round(moved, 3), f"load in the rear as {like.name}, {ASSUMED}")
    if "vehicle.cog_height" in answers:
        higher = (car.laden_cog_height or car.cog_height) / car.cog_height
        height = round(values["cog_height"].value * higher, 3)
        values["laden_cog_height"] = Value(height, f"in proportion to {like.name}, {ASSUMED}")
    return values


def _origin(key: str, like: Config, taken: Collection[str]) -> str:
    return f"as {like.name}, {ASSUMED}" if key in taken else "data sheet"


def _from_load(answers: Given, key: str, mass: float, wheelbase: float) -> Value:
    load = float(answers[key])
    if not 0.2 * mass <= load <= 0.8 * mass:
        remedy = f"{load:g} kg of {mass:g} kg is no axle load of a car; give the front axle's alone"
        raise UserError("config new", key, remedy)
    return Value(round(wheelbase * (1.0 - load / mass), 3), f"from {load:g} kg of {mass:g} kg in front")


def _axle(axle: str, answers: Given, like: Config, taken: Collection[str]) -> dict[str, Value]:
    usual = like.front if axle == "front" else like.rear
    values = {
        key: Value(value, f"as {like.name}, {ASSUMED}")
        for key, value in usual
        if value is not None and not isinstance(value, Section)
    }

    def given(name: str) -> Any:
        return answers.get(f"{axle}.{name}")

    size = str(given("tyre"))
    radius = sheet.tyre_radius(size, "config new", f"{axle}.tyre")
    values["unloaded_radius"] = Value(round(radius, 4), f"tyre {size}")
    pistons = int(given("pistons"))
    if given("calliper") == sheet.FIXED:
        if pistons % 2:
            remedy = f"a fixed calliper has as many pistons on both sides (found {pistons}); give their sum"
            raise UserError("config new", f"{axle}.pistons", remedy)
        pistons //= 2
    counted = _origin(f"{axle}.pistons", like, taken)
    values["pistons"] = Value(pistons, f"{given('calliper')} calliper, {counted}")
    piston = float(given("piston_diameter")) / 1000.0
    values["piston_diameter"] = Value(round(piston, 5), _origin(f"{axle}.piston_diameter", like, taken))
    if given("effective_radius") is not None:
        values["effective_radius"] = Value(float(given("effective_radius")) / 1000.0, "data sheet")
    else:
        disc = float(given("disc_diameter")) / 1000.0
        origin = f"disc of {1000.0 * disc:g} mm less the piston, {ASSUMED}: some 5 %"
        values["effective_radius"] = Value(round(0.5 * (disc - piston), 4), origin)
    if given("mu_nominal") is not None:
        values["mu_nominal"] = Value(given("mu_nominal"), "data sheet")
    return values


def _equal_pressure_share(axles: dict[str, dict[str, Value]]) -> float:
    """Return the front axle's share of the brake force with one pressure in all callipers."""
    forces = []
    for row in axles.values():
        lever = row["effective_radius"].value * row["mu_nominal"].value / row["unloaded_radius"].value
        forces.append(row["pistons"].value * row["piston_diameter"].value ** 2 * lever)
    return float(forces[0] / sum(forces))


def _table(name: str, values: dict[str, Value], model: type[Section]) -> Iterator[str]:
    """Yield the lines of a table, its keys in the order of the model."""
    yield ""
    yield f"[{name}]"
    described = descriptions(model)
    for key, field in model.model_fields.items():
        if key in values:
            unit = unit_of(field)
            line = f"{key} = {toml_value(values[key].value)}"
            what = brief(described.get(key, key), unit)
            shown = "" if unit in (None, "-") else f"{unit}, "
            yield f"{line:<31}  # {shown}{what}; {values[key].origin}"


def brief(description: str, unit: str | None) -> str:
    """Return the first part of a key's description, without its unit."""
    first = " ".join(description.split()).partition(". ")[0].partition(": ")[0].partition("; ")[0].rstrip(".")
    return f"{first[:1].lower()}{first[1:]}".replace(f", {unit}", "").removesuffix(", -")


def _tell(out: Path, config: Config) -> int:
    params = new_params(config)[0]
    found = violations(out, config, params)
    for line in figures(config, params):
        print(line)
    print(f'{out}: written; lines that end in "{ASSUMED}" are another car\'s')
    print(f"next: brake-ecu config check {argument(out)}")
    give(written=[out], next=f"brake-ecu config check {argument(out)}")
    identified = argument(f"{out.stem}-identified.toml")
    print(f"      brake-ecu identify vehicle DRIVE… --config {argument(out)} --out {identified}")
    for finding in found:
        fault(f"brake-ecu: {finding}")
    return 1 if found else 0
