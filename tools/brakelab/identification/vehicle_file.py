"""Writes what was identified: a CONFIG that includes START, and the signal map with the zeros taken off."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from brakelab.identification.car_file import split_include, toml_value
from brakelab.identification.vehicle_identify import Zeros
from brakelab.identification.vehicle_parameters import ROUGH, Parameter
from ecu.errors import UserError
from ecu.settings.config import Config, validate_config

SECTIONS: Final = ("vehicle", "front", "rear", "sensors")
SURE: Final = 2.0  # standard deviations: a zero that is one
SMALLEST: Final = {"accel_x": 0.05, "accel_y": 0.05, "yaw_rate": 0.002, "calliper_pressure": 0.3}
"""Standard deviations from which a zero is not taken off, in the signal's unit."""


def car_toml(
    start: Path, out: Path, parameters: Sequence[Parameter], config: Config, drives: Sequence[str]
) -> str:
    """Return CAR: START's content by an `include`, the fitted keys, and as comments what was not told."""
    source, kept = split_include(start)
    include = os.path.relpath(source.resolve(), out.resolve().parent).replace("\\", "/")
    told = [one for one in parameters if not one.remedy]
    lines = [
        f"# Identified by `brake-ecu identify vehicle` from {', '.join(drives)}; ± is 1 σ.",
        f"# Keys that no drive told are those of {start.name}.",
        f'include = "{include}"',
        *_entries({name: value for name, value in kept.items() if not isinstance(value, dict)}),
    ]
    others = [name for name, value in kept.items() if isinstance(value, dict) and name not in SECTIONS]
    for section in (*SECTIONS, *others):
        values = dict(kept.get(section, {}))
        fitted = {one.key.partition(".")[2]: one for one in told if one.key.startswith(f"{section}.")}
        tables = {name: value for name, value in values.items() if isinstance(value, dict)}
        values = {name: v for name, v in values.items() if name not in fitted and name not in tables}
        if not values and not fitted and not tables:
            continue
        lines += ["", f"[{section}]", *_entries(values), *map(_fitted, fitted.values())]
        lines += _laden(fitted, config) if section == "vehicle" else []
        for name, table in tables.items():
            lines += ["", f"[{section}.{name}]", *_entries(table)]
    left = [one for one in parameters if one.remedy]
    if left:
        lines += ["", f"# Not told, {start.name}'s value:"]
        lines += [f"# {one.key} = {one.start:.4g} {one.unit}: {one.remedy} would tell it" for one in left]
    return "\n".join([*lines, ""])


def _fitted(one: Parameter) -> str:
    name = one.key.partition(".")[2]
    unit = "" if one.unit == "-" else f"{one.unit}, "
    rough = ", rough" if one.sigma > ROUGH * abs(one.value) else ""
    origin = f"{one.source}; {one.windows} half seconds"
    return f"{name} = {one.value:.6g} # {unit}± {one.sigma:.2g}{rough}; {origin}; was {one.start:.6g}"


def _laden(fitted: dict[str, Parameter], config: Config) -> list[str]:
    laden = config.vehicle.laden_mass
    if "mass" not in fitted or laden is None or laden >= fitted["mass"].value:
        return []
    return [f"laden_mass = {fitted['mass'].value:.6g} # kg, START's is less than the mass"]


def _entries(values: dict[str, Any]) -> list[str]:
    return [f"{name} = {toml_value(value)}" for name, value in values.items()]


def write_car(
    start: Path, out: Path, parameters: Sequence[Parameter], config: Config, drives: Sequence[str]
) -> list[Parameter]:
    """Write CAR and return the parameters as written: one out of its key's range is left at START's value.

    Raises:
        UserError: the file cannot be written, or no CONFIG results.
    """
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        for _ in range(2):
            out.write_text(car_toml(start, out, parameters, config, drives), encoding="utf-8")
            wrong = validate_config(out)
            if isinstance(wrong, Config):
                return list(parameters)
            places = {one.place for one in wrong}
            parameters = [
                one._replace(remedy=f"{one.value:.4g} is out of range; a longer drive, or a better START,")
                if one.key in places
                else one
                for one in parameters
            ]
    except OSError as error:
        raise UserError(str(out), "", f"cannot be written ({error.strerror}); choose another --out") from None
    assert not isinstance(wrong, Config)
    raise wrong[0]


def offsets(zeros: Zeros) -> dict[str, float]:
    """Return zeros that are sure, by input: what a map has to take off."""
    found = {"accel_x": zeros.accel_x, "accel_y": zeros.accel_y, "yaw_rate": zeros.yaw_rate}
    sure = {
        name: told[0]
        for name, told in found.items()
        if told and abs(told[0]) > SURE * told[1] and told[1] < SMALLEST[name]
    }
    for name, value, sigma in zeros.pressure:
        if abs(value) > SURE * sigma and sigma < SMALLEST["calliper_pressure"]:
            sure.setdefault(name, value)
    return sure


def map_toml(map: Path, out: Path, zeros: dict[str, float]) -> str:
    """Return the text of `map` with `zeros` taken off its inputs, for a file `out`."""
    text = map.read_text(encoding="utf-8")
    database = re.search(r'^database\s*=\s*"(.*)"', text, re.MULTILINE)
    if database:
        path = os.path.relpath((map.parent / database[1]).resolve(), out.resolve().parent).replace("\\", "/")
        text = text.replace(database[0], f'database = "{path}"', 1)
    for name, zero in zeros.items():
        line = re.search(rf"^{name}\s*=\s*\{{(.*)\}}(.*)$", text, re.MULTILINE)
        if line is None:
            continue
        inside = line[1]
        old = re.search(r",\s*offset\s*=\s*([-+\d.eE]+)", inside)
        value = (float(old[1]) if old else 0.0) - zero
        inside = inside.replace(old[0], "") if old else inside
        text = text.replace(line[0], f"{name} = {{{inside.rstrip()}, offset = {value:.5g} }}{line[2]}", 1)
    return text
