"""Writes what was identified: a CONFIG that includes START, and the signal map with the zeros taken off."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import tomlkit

from brakelab.identify.config_file import Section, write_car
from brakelab.identify.vehicle.parameters import Parameter
from brakelab.identify.vehicle.solve import Zeros
from brakelab.logs.column_map import maps_columns, read_column_map
from brakelab.logs.log_quality import SignalQuality
from brakelab.logs.signal_batches import mapped_batches
from ecu.bus.database import find_signal, read_database
from ecu.bus.signal_map import read_signal_map
from ecu.bus.units import conversion
from ecu.contract.signals import INPUT, INPUT_SIGNALS
from ecu.settings.config import Config, validate_config

SURE: Final = 2.0  # standard deviations: a zero that is one
LARGEST_SIGMA: Final = {"accel_x": 0.05, "accel_y": 0.05, "yaw_rate": 0.002, "calliper_pressure": 0.3}
"""Standard deviations from which a zero is not taken off, in the signal's unit."""


def sections_of(parameters: Sequence[Parameter], config: Config) -> dict[str, Section]:
    """Return the fitted keys by the names of their tables; a laden mass below the mass goes along."""
    sections: dict[str, Section] = {}
    for one in parameters:
        if not one.remedy:
            section, _, name = one.key.partition(".")
            sections.setdefault(section, {})[name] = _fitted(one)
    vehicle = sections.get("vehicle", {})
    laden = config.vehicle.laden_mass
    if "mass" in vehicle and laden is not None and laden < float(vehicle["mass"][0]):
        vehicle["laden_mass"] = vehicle["mass"][0], "kg, START's is less than the mass"
    return sections


def head_of(parameters: Sequence[Parameter], start: str, drives: Sequence[str], checked: str) -> str:
    """Return the first lines of CAR: where its keys are from, how they predict, which no drive identified."""
    lines = [f"# Identified by `brake-ecu identify vehicle` from {', '.join(drives)}; ± is 1 σ."]
    lines.append(f"# {checked}")
    if left := [one for one in parameters if one.remedy]:
        lines += [f"# Not identified, {start}'s value:"]
        lines += [f"# {one.key} = {one.start:.4g} {one.unit}: needs {one.remedy}" for one in left]
    return "\n".join(lines)


def _fitted(one: Parameter) -> tuple[str, str]:
    unit = "" if one.unit == "-" else f"{one.unit}, "
    origin = f"{one.source}; {one.windows} half seconds"
    return f"{one.value:.6g}", f"{unit}± {one.sigma:.2g}{one.doubt}; {origin}; was {one.start:.6g}"


def write_vehicle(
    start: Path,
    out: Path,
    parameters: Sequence[Parameter],
    config: Config,
    drives: Sequence[str],
    checked: str,
) -> list[Parameter]:
    """Write CAR and return the parameters as written: one out of its key's range is left at START's value.

    `checked`: the line of the cross-check, for the head.

    Raises:
        UserError: the file cannot be written, or no CONFIG results.
    """
    for _ in range(2):
        write_car(
            start, out, head_of(parameters, start.name, drives, checked), sections_of(parameters, config)
        )
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
    assert not isinstance(wrong, Config)
    raise wrong[0]


def offsets(zeros: Zeros) -> dict[str, float]:
    """Return zeros that are sure, by input: what a map has to take off."""
    found = {"accel_x": zeros.accel_x, "accel_y": zeros.accel_y, "yaw_rate": zeros.yaw_rate}
    sure = {
        name: zero[0]
        for name, zero in found.items()
        if zero and abs(zero[0]) > SURE * zero[1] and zero[1] < LARGEST_SIGMA[name]
    }
    for name, value, sigma in zeros.pressure:
        if abs(value) > SURE * sigma and sigma < LARGEST_SIGMA["calliper_pressure"]:
            sure.setdefault(name, value)
    return sure


def unit_scales(map: Path, drive: Path) -> dict[str, float]:
    """Return the unit in which the map has each input, in the contract's; `drive` says those of its columns.

    Raises:
        UserError: the map or its database is not right.
    """
    if maps_columns(map):
        mapped = read_column_map(map)
        own = mapped.content.inputs
        use, _ = mapped_batches(drive, SignalQuality(), mapped)
        scales = {INPUT_SIGNALS[one.place].name: one.factor for one in use.columns}
        return {name: scale / own[name].factor for name, scale in scales.items()}
    content = read_signal_map(map)
    database = read_database(map.parent / content.database).database
    scales = {}
    for name, one in content.inputs.items():
        signal = find_signal(database.get_message_by_name(one.message), one.signal, map, map, name)
        unit = one.unit if one.unit is not None else signal.unit or ""
        wanted = INPUT_SIGNALS[INPUT[name]].unit
        scales[name] = conversion(unit, wanted, content.rolling_radius, str(map), f"inputs.{name}")[0]
    return scales


def map_toml(map: Path, out: Path, zeros: dict[str, float], scales: dict[str, float]) -> str:
    """Return the text of `map` with `zeros` taken off its inputs, for a file `out`.

    `scales`: the unit of each input in the contract's.
    """
    document: Any = tomlkit.parse(map.read_text("utf-8-sig"))
    if "database" in document:
        path = (map.parent / str(document["database"])).resolve()
        document["database"] = Path(os.path.relpath(path, out.resolve().parent)).as_posix()
    for name, zero in zeros.items():
        if source := document["inputs"].get(name):
            source["offset"] = tomlkit.value(f"{source.get('offset', 0.0) - zero / scales[name]:.5g}")
    return document.as_string()
