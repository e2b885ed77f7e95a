"""`brake-ecu map suggest`: proposes a signal map that the user then edits."""

import math
import os
import tomllib
from pathlib import Path
from typing import Final

import numpy as np
from cantools.database import Database
from rich.console import Console
from rich.table import Table

from brakelab.logs.column_map import ColumnMap, MappedFile
from brakelab.logs.formats import kind_of, read_frames
from brakelab.logs.physics.samples import ANY_CAR, Car, car_of
from brakelab.logs.signal_file import read_signals
from brakelab.mapping.columns import column_map_text, read_column_series, with_lags
from brakelab.mapping.drive_torque import motors
from brakelab.mapping.map_text import input_lines, needs_radius, radius_line
from brakelab.mapping.motion import Found, wheel_speeds
from brakelab.mapping.names import COUNTING, converts, words
from brakelab.mapping.physics import propose
from brakelab.mapping.series import FEWEST_FRAMES, Series, read_series
from brakelab.mapping.sources import Source, other_sources
from brakelab.mapping.torque import FORMULA, brake_torque, stand_in
from brakelab.replay.log import log_size
from brakelab.replay.quality import Findings, damage_lines
from brakelab.results.console import WIDTH
from brakelab.results.outputs import check_outputs, config_files, write_text
from brakelab.results.progress import progress_bar
from ecu.bus.database import read_database
from ecu.bus.signal_map import SLOWEST_S, load_signal_map
from ecu.contract.signals import INPUT, INPUT_SIGNALS, without_corner
from ecu.errors import UserError
from ecu.output import argument, give, say
from ecu.settings.config import load_config, new_params

WANTED: Final = (
    *("wheel_speed_fl", "accel_x", "accel_y", "yaw_rate", "steering_angle", "calliper_pressure_fl"),
    *("pedal_position", "accelerator_position", "motor_torque_fl", "abs_active"),
)
SPARE: Final = 1.5  # time-out over the longest gap seen
LONGEST_GAP: Final = 0.5  # s, a gap beyond it is a sender that fell silent
SHOWN: Final = 20  # names in a line
PERIODS: Final = 3.0  # likewise, of a sender that is slow
STEP: Final = 0.05  # s, time-outs are rounded up to it


def suggest(log: Path, dbc: Path | None, config: Path | None, out: Path | None) -> None:
    """Print a proposal with its evidence; write it to `out`, or print it where there is none.

    `config` is of the car: where it sends a brake torque in place of pressures, its brakes turn one into the
    others.

    Raises:
        UserError: the log, the database, `config` or `out` is not right, or no speed was found, against which
            everything else is judged.
    """
    if out is not None:
        given = [log, *([dbc] if dbc else []), *(config_files(config) if config else [])]
        check_outputs(out, (out,), given, toml=True)
    params = new_params(load_config(config))[0] if config else None
    car = ANY_CAR if params is None else car_of(params)
    if kind_of(log) == "signals":
        _suggest_columns(log, out, car)
        return
    if dbc is None:
        raise UserError("--dbc", "", f"missing; {log} holds frames: give the database of this car")
    database, overlapping = _load(dbc)
    findings = Findings(log)
    interfaces = findings.interfaces
    with progress_bar("map suggest", log_size(log)) as advance:
        series = read_series(read_frames(log, interfaces, findings.log, advance), database)
    for line in damage_lines(findings):
        say(line)
    found, motion = propose(series, car)
    if motion is None:
        raise UserError(str(dbc), "", f"names no speed in {log}; give the database of this car")
    _refuse_unitless(dbc, found[0].series, "give it there", car)
    bus = found[0].series.bus
    here = [one for one in series if one.bus == bus]
    hints: list[str] = []
    if not any(one.target.startswith("calliper_pressure") for one in found):
        torque = brake_torque(here, motion)
        if torque and params is not None:
            found += stand_in(torque, params)
        elif torque:
            name = f"{torque[0].message}.{torque[0].signal} [{torque[0].unit}]"
            remedy = f"a brake torque can stand in for pressures, {FORMULA}; --config CONFIG writes it"
            hints = [f"{name} follows the deceleration: {remedy}"]
    wheels = wheel_speeds(series)
    if wheels and not any(one.target.startswith("motor_torque") for one in found):
        found += motors(here, wheels, motion)
    strict = not any(one.series.message in overlapping for one in found)
    others = other_sources(found, here, motion, car)
    comments = [*hints, *map(str, others)]
    text = map_text(found, here, (out or Path("map.toml")), dbc, strict, interfaces, bus, comments, car)
    _show(found, motion.drives, others, hints)
    _give(log, text, out)
    if out is not None:
        load_signal_map(out)


def _warnings(found: list[Found]) -> list[str]:
    """Return a line for each thing to look into; wheels that share it share the line."""
    names: dict[tuple[str, str], str] = {}
    for one in found:
        stem = without_corner(one.target)
        several = (stem, one.warning) in names
        names[stem, one.warning] = f"{stem}_*" if several else one.target
    return [f"{name}: {warning}" for (_, warning), name in names.items() if warning]


def _suggest_columns(log: Path, out: Path | None, car: Car) -> None:
    """Propose a map of the columns of a signal file, as `suggest` does of frames."""
    findings = Findings(log)
    with progress_bar("map suggest", None):
        columns, series = read_column_series(log, findings.signals)
        found, motion = propose(series, car)
    for line in damage_lines(findings):
        say(line)
    if motion is None:
        among = f"no speed by its name and unit among {', '.join(columns.names[:SHOWN])}"
        if not series:
            among += f", of which none has {FEWEST_FRAMES} numbers at times of their own"
        raise UserError(str(log), "", f"{among}; write the map by hand (docs/signal-maps.md)")
    wheel = found[0].series
    so = "take it as it is" if "t" in columns.names else "call its time t"
    own = f"; or {so}: the contract's names have the contract's units, and need no map"
    own = own if wheel.signal in INPUT else ""
    _refuse_unitless(log, wheel, f'write it behind the names: "{wheel.signal} [km/h]"{own}', car)
    found = with_lags(found, motion)
    others = other_sources(found, series, motion, car)
    _show(found, motion.drives, others, [])
    after = {one.target: timeout(one) for one in found}
    text = column_map_text(log, columns, found, after, car) + "".join(f"# {one}\n" for one in others)
    _read_by(text, log, max(float(one.t[-1]) for one in series))
    _give(log, text, out)


def _read_by(text: str, log: Path, seconds: float) -> None:
    """Read the beginning of a signal file by a map. Raises UserError where a replay would refuse it."""
    mapped = MappedFile(log.with_suffix(".toml"), ColumnMap.model_validate(tomllib.loads(text)))
    begin = None
    for block in read_signals(log, Findings(log).signals, mapped):
        begin = float(block.t[0]) if begin is None else begin
        if block.t[-1] > begin + seconds:
            break


def _refuse_unitless(where: Path, wheel: Series, remedy: str, car: Car) -> None:
    """Refuse a wheel speed of no unit: all else is judged by it, and would be bent to fit a wrong one."""
    if converts(wheel.unit, "rad/s") or converts(wheel.unit, "m/s"):
        return
    fastest = float(np.nanmax(np.abs(wheel.value)))
    turning = fastest * float(car.radius.mean())
    speeds = {"rad/s": turning, "rpm": turning * math.tau / 60.0, "km/h": fastest / 3.6}
    known = ", ".join(f"{speed:.0f} m/s if it is {unit}" for unit, speed in speeds.items())
    raise UserError(str(where), wheel.signal, f"no unit is stated for this wheel speed; {remedy} ({known})")


def _give(log: Path, text: str, out: Path | None) -> None:
    """Print a map, or write it."""
    give(map=text)
    if out is None:
        print(text)
        return
    write_text(out, text)
    following = f"brake-ecu map check {argument(log)} --map {argument(out)}"
    give(written=[out], next=following)
    for line in (f"written: {out}; check and edit it", f"next: {following}"):
        say(line)


def _load(dbc: Path) -> tuple[Database, list[str]]:
    """Return the messages of a database that can be used, and the names of those that want strict = false."""
    database, mistakes = read_database(dbc)
    for mistake in mistakes[:SHOWN]:
        text = mistake.remedy.partition(";")[0] if mistake.tolerable else f"{mistake.remedy}; left out"
        say(f"{dbc}: {mistake.place}: {text}")
    if len(mistakes) > SHOWN:
        say(f"{dbc}: {len(mistakes) - SHOWN} more mistakes")
    spoilt = {mistake.message for mistake in mistakes if not mistake.tolerable}
    usable = [message for message in database.messages if message.name not in spoilt]
    overlapping = [mistake.message for mistake in mistakes if mistake.tolerable]
    return Database(usable, strict=False), overlapping


def _show(found: list[Found], drives: bool, others: list[Source], hints: list[str]) -> None:
    console = Console(stderr=True)
    if not console.is_terminal:
        console = Console(stderr=True, width=WIDTH)
    table = Table(title="proposed", title_justify="left")
    for column in ("input", "message", "signal", "unit", "factor", "why"):
        table.add_column(column)
    rows: dict[tuple[str, str], list[Found]] = {}
    for one in found:
        rows.setdefault((without_corner(one.target), one.evidence), []).append(one)
    for (stem, evidence), ones in rows.items():
        signals = " ".join(dict.fromkeys(one.series.signal for one in ones))
        first = ones[0]
        table.add_row(stem, first.series.message, signals, first.unit, f"{first.factor:.4g}", evidence)
    console.print(table)
    names = ("target", "factor", "offset", "unit", "evidence", "sure", "warning")
    give(inputs=[{name: getattr(one, name) for name in names} | _source(one) for one in found])
    if others:
        table = Table(title="not proposed", title_justify="left")
        for column in ("input", "signal", "unit", "why"):
            table.add_column(column)
        for other in others:
            table.add_row(without_corner(other.target), other.name, other.series.unit, other.evidence)
        console.print(table)
    given = [{"target": one.target, "evidence": one.evidence, "unit": one.series.unit} for one in others]
    give(others=[row | _source(one) for row, one in zip(given, others, strict=True)])
    targets = {one.target for one in found} | {one.target for one in others}
    missing = [without_corner(name) for name in WANTED if name not in targets]
    if missing:
        console.print(f"nothing found for {', '.join(missing)}", highlight=False)
    if not drives:
        console.print("the car stands in this log: signs and scales could not be checked", highlight=False)
    for line in hints + _warnings(found):
        say(line)


def _source(found: Found | Source) -> dict[str, str]:
    return {"message": found.series.message, "signal": found.series.signal}


def _counter(series: list[Series], message: str) -> str | None:
    """Return the signal that counts a message's frames, as the value of a map's key, None: there is none.

    A counter that starts again before its bits are full, as AUTOSAR's at 15, has a modulo.
    """
    for one in series:
        if one.message != message or not COUNTING & set(words(one.signal)):
            continue
        steps = np.diff(one.value)
        if len(steps) and np.mean(np.isin(steps, (1.0, -one.value.max()))) > 0.7 and one.value.max() > 1:
            modulo = int(one.value.max()) + 1
            early = bool(np.any(steps == 1 - modulo)) and modulo & (modulo - 1) != 0
            return f'{{ signal = "{one.signal}"{f", modulo = {modulo}" if early else ""} }}'
    return None


def timeout(found: Found) -> float | None:
    """Return the time-out [s] that spans the gaps of a signal, None: the contract's does."""
    usual = INPUT_SIGNALS[INPUT[found.target]].timeout_s
    silent = max(LONGEST_GAP, PERIODS * found.series.period)
    wanted = min(SPARE * min(found.series.longest_gap, silent), SLOWEST_S)
    return round(STEP * math.ceil(wanted / STEP - 1e-9), 3) if wanted > usual else None


def map_text(
    found: list[Found],
    series: list[Series],
    out: Path,
    dbc: Path,
    strict: bool,
    interfaces: list[str],
    bus: int,
    hints: list[str],
    car: Car = ANY_CAR,
) -> str:
    """Return the proposal as the text of a signal map whose place will be `out`; `hints` become comments."""
    database = os.path.relpath(dbc.resolve(), out.resolve().parent)
    lines = [
        "# Proposed from a recorded drive: check every line, above all the signs (ISO 8855).",
        "# docs/signal-maps.md explains the keys.",
        "",
        f'database = "{database}"',
    ]
    if not strict:
        lines.append("strict = false              # signals of this database overlap")
    if len(interfaces) > 1:
        lines.append(f'bus = "{interfaces[bus]}"')
    if needs_radius(found):
        lines.append(radius_line(car))
    for message in dict.fromkeys(one.series.message for one in found):
        first = next(one.series for one in found if one.series.message == message)
        lines += ["", f"[messages.{message}]", f"period = {first.period:.3g}"]
        if first.mean_interval > 1.5 * first.period:
            lines.append(f"slowest_period = {first.mean_interval:.2g}      # frames are lost or irregular")
        counter = _counter(series, message)
        if counter:
            lines.append(f"counter = {counter}")
    lines += ["", "[inputs]"]
    for before, one in zip([None, *found], found, strict=False):
        source = f'message = "{one.series.message}", signal = "{one.series.signal}"'
        if one.series.sign:
            source += f', sign = {{ signal = "{one.series.sign}", values = [1] }}'
        lines += input_lines(one, before, source, timeout(one))
        if one.series.longest_gap > max(LONGEST_GAP, PERIODS * one.series.period):
            lines.append(
                f"# {one.target}: no value for {one.series.longest_gap:.2f} s: look at the log there"
            )
    lines += [f"# {hint}" for hint in hints]
    return "\n".join(lines) + "\n"
