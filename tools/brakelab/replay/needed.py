"""Report on the inputs that the ECU needs: one line for each unusable group, one for the cost of inputs that
a log does not have, and one for the faults that lasted most of a drive.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from brakelab.replay.quality import Findings
from ecu.contract.faults import DEGRADING, FAULTS, IMU_LOST, PRESSURE_LOST, REQUEST_LOST, WHEEL_SPEED_LOST
from ecu.contract.records import RecordArray
from ecu.contract.signals import (
    ACCEL_X,
    ACCEL_Y,
    CALLIPER_PRESSURE,
    CORNERS,
    CYCLE_NS,
    DECEL_DEMAND,
    INPUT_SIGNALS,
    MOTOR_TORQUE,
    PEDAL_POSITION,
    STEERING_ANGLE,
    VEHICLE_SPEED,
    WHEEL_FORCE_X,
    WHEEL_SPEED,
    YAW_RATE,
)


class Group(NamedTuple):
    """Inputs that share one line."""

    name: str
    places: tuple[int, ...]
    alternatives: bool = False
    """One of them is enough, and only what is mapped is missed."""


WHEELS: Final = range(WHEEL_SPEED, WHEEL_SPEED + len(CORNERS))
NEEDED: Final = (
    Group("wheel_speed_*", tuple(WHEELS)),
    Group("accel_x", (ACCEL_X,)),
    Group("calliper_pressure_*", tuple(range(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4))),
    Group("pedal_position, decel_demand", (PEDAL_POSITION, DECEL_DEMAND), alternatives=True),
)
HELPFUL: Final = (
    (
        Group("vehicle_speed", (VEHICLE_SPEED,)),
        "the wheels alone tell the speed: wider sigma where all slip",
    ),
    (
        Group("motor_torque_*", tuple(range(MOTOR_TORQUE, MOTOR_TORQUE + 4))),
        "mass stays as configured, an engine's drag widens sigma",
    ),
    (Group("accel_y", (ACCEL_Y,)), "lateral load transfer by yaw rate and speed"),
    (Group("yaw_rate", (YAW_RATE,)), "yaw rate by lateral acceleration and speed"),
    (Group("steering_angle", (STEERING_ANGLE,)), "cornering forces of the front axle are not separated"),
)
"""Inputs that a car may lack, and the estimates that suffer without them."""
STAND_IN: Final = (
    {ACCEL_X: "the change of speed"}
    | dict.fromkeys(WHEELS, "the speed of the car, which shows no slip,")
    | dict.fromkeys(range(CALLIPER_PRESSURE, CALLIPER_PRESSURE + len(CORNERS)), "that of another wheel")
)
NO_PRESSURE: Final = (
    "no calliper pressure, so friction cannot be estimated; map the pressures, or a brake torque "
    "in their place (docs/signal-maps.md)"
)
MAJORITY: Final = 0.5
"""Share of its samples above which an input counts as refused; of a drive, above which a time is in %."""


def needed_lines(found: Findings) -> list[str]:
    """Return a line for each group of needed inputs that this log gave mostly refused, or not at all."""
    if found.freshness is None:
        return []
    lines = []
    for group in NEEDED:
        places = [place for place in group.places if found.mapped[place] or not group.alternatives]
        if group.places[0] == CALLIPER_PRESSURE and not has_pressure(found):
            lines.append(f"{found.path}: {NO_PRESSURE}")
            continue
        causes = {place: _cause(found, place) for place in places}
        bad = [place for place in places if causes[place]]
        if group.alternatives and any(found.freshness["taken"][list(group.places)]):
            bad = [place for place in bad if found.freshness["outside"][place]]
        for cause in dict.fromkeys(causes[place] for place in bad):
            shown = [place for place in bad if causes[place] == cause]
            names = group.name if len(shown) == len(group.places) else _names(shown)
            lines.append(f"{found.path}: {names}: {_share(found.freshness, shown)}{cause}")
    return lines


def has_pressure(found: Findings) -> bool:
    """Return whether this log has any calliper pressure, usable or not."""
    if found.freshness is None:
        return True
    known = found.freshness[CALLIPER_PRESSURE : CALLIPER_PRESSURE + len(CORNERS)]
    return any(known[kind].any() for kind in ("taken", "outside", "invalid"))


def request_line(found: Findings) -> list[str]:
    """Return the line for a log of a car that nobody could ask to brake: no demand is mapped."""
    if found.freshness is None or found.mapped[[PEDAL_POSITION, DECEL_DEMAND]].any():
        return []
    return [f"{found.path}: pedal_position, decel_demand: not mapped; nothing is demanded of this ECU"]


def lacking_line(found: Findings) -> list[str]:
    """Return one line that names the helpful inputs that this log does not have, and the cost of each."""
    if found.freshness is None:
        return []
    lacking = [
        f"{group.name} ({cost})"
        for group, cost in HELPFUL
        if not found.freshness["taken"][list(group.places)].any()
    ]
    return [f"{found.path}: without {'; '.join(lacking)}"] if lacking else []


def transducer_line(found: Findings, observer: str) -> list[str]:
    """Return the line for `observer` 1 on a log without wheel transducers: it works as Observer 2."""
    places = slice(WHEEL_FORCE_X, WHEEL_FORCE_X + len(CORNERS))
    if observer != "observer1" or found.freshness is None or found.freshness["taken"][places].any():
        return []
    remedy = "the forces are virtual, as of observer2; give the wheel transducers, or take observer2"
    return [f"{found.path}: wheel_force_x_*: no sample for observer1; {remedy}"]


def nothing_usable(logs: Sequence[Findings]) -> bool:
    """Return whether no needed input had a single valid sample in the whole drive."""
    places = [place for group in NEEDED for place in group.places]
    return not any(found.freshness["taken"][places].any() for found in logs if found.freshness is not None)


def fault_lines(found: Findings) -> list[str]:
    """Return a line that names the faults that degraded or failed the ECU in this log, and how long.

    What is not mapped is reported elsewhere; beside it counts how long the longest of the others lasted.
    """
    if not found.faulty_rows:
        return []

    def extent(rows: int) -> str:
        share = rows / found.rows
        return _percent(share) if share > MAJORITY else f"{1e-9 * CYCLE_NS * rows:.2f} s"

    reported = 0 if has_pressure(found) else PRESSURE_LOST
    reported |= 0 if found.mapped[list(WHEELS)].any() else WHEEL_SPEED_LOST
    reported |= 0 if found.mapped[ACCEL_X] else IMU_LOST
    causes = [fault for fault in FAULTS if fault.bit & (DEGRADING | REQUEST_LOST) & ~reported]
    lasting = sorted(causes, key=lambda fault: -found.fault_rows[fault.bit])
    names = [
        f"{fault.name} ({extent(found.fault_rows[fault.bit])})"
        for fault in lasting
        if found.fault_rows[fault.bit]
    ]
    if not names:
        return []
    beside = any(found.fault_rows[fault.bit] for fault in FAULTS if fault.bit & reported)
    rows = found.fault_rows[lasting[0].bit] if beside else found.faulty_rows
    return [f"{found.path}: degraded or failed for {extent(rows)} of the drive: {', '.join(names)}"]


def _cause(found: Findings, place: int) -> str:
    """Return the fault of an input and its remedy, empty: none."""
    assert found.freshness is not None
    known, signal = found.freshness[place], INPUT_SIGNALS[place]
    taken, outside, invalid = int(known["taken"]), int(known["outside"]), int(known["invalid"])
    if not taken + outside + invalid:
        alone = place in WHEELS and not found.mapped[VEHICLE_SPEED]
        if not found.mapped[place] and place in STAND_IN and not alone:
            return f"not mapped; {STAND_IN[place]} stands for it"
        if found.reception is None:
            return "no sample in the whole log; fill this column"
        return "no sample in the whole log; check its sender, or map it"
    if outside + invalid <= MAJORITY * (taken + outside + invalid):
        return ""
    if outside > invalid:
        return f"of samples outside {signal.low:g}…{signal.high:g} {signal.unit}; is the unit {signal.unit}?"
    return "of samples declared invalid or not available; check its sender, or the map's validity"


def _share(freshness: RecordArray, places: Sequence[int]) -> str:
    rows = freshness[list(places)]
    refused = int(rows["outside"].sum() + rows["invalid"].sum())
    total = refused + int(rows["taken"].sum())
    return f"{_percent(refused / total)} " if total else ""


def _names(places: Sequence[int]) -> str:
    return ", ".join(INPUT_SIGNALS[place].name for place in places)


def _percent(share: float) -> str:
    return f"{np.floor(100 * share):.0f} %"
