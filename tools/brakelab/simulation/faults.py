"""Fault injection: `[[fault]]` tables of a scenario. `fault_kernels.py` applies them; docs/rig.md lists them.

Frames are disturbed in transit, after end-to-end protection; a signal is disturbed before it, so that its
frame is intact.
"""

import math
import re
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Final, Literal, NamedTuple, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from brakelab.arrays import Vector
from ecu.bus.transmit import contract_transmit_plan
from ecu.contract.records import RecordArray, new_record
from ecu.contract.signals import CORNERS, INPUT, N_INPUTS
from ecu.settings.described import describe_keys
from ecu.settings.resources import resource
from ecu.settings.toml_file import Unit

Kind = Literal[
    "late",
    "jittered",
    "batched",
    "held_up",
    "lost",
    "doubled",
    "corrupted",
    "bus_off",
    "daemon_killed",
    "stuck",
    "set",
    "invalid",
    "biased",
    "noisy",
    "scaled",
    "drifting",
    "scale_drifting",
    "delayed",
    "swapped",
    "motor_lost",
    "calliper_dead",
    "accumulator_low",
]
KINDS: Final[tuple[str, ...]] = get_args(Kind)
LATE, JITTERED, BATCHED, HELD_UP, LOST, DOUBLED, CORRUPTED, BUS_OFF, DAEMON_KILLED = range(9)
STUCK, SET, INVALID, BIASED, NOISY, SCALED, DRIFTING, SCALE_DRIFTING, DELAYED, SWAPPED = range(9, 19)
MOTOR_LOST, CALLIPER_DEAD, ACCUMULATOR_LOW = range(19, len(KINDS))
_FRAMES: Final = {"message", "share"}
KEYS: Final[dict[str, set[str]]] = {
    "late": {*_FRAMES, "delay"},
    "jittered": {*_FRAMES, "delay"},
    "batched": {*_FRAMES, "delay"},
    "held_up": _FRAMES,
    "lost": _FRAMES,
    "doubled": _FRAMES,
    "corrupted": _FRAMES,
    "bus_off": set(),
    "stuck": {"signal"},
    "set": {"signal", "amount"},
    "invalid": {"signal"},
    "biased": {"signal", "amount"},
    "noisy": {"signal", "amount"},
    "scaled": {"signal", "amount"},
    "drifting": {"signal", "rate", "limit"},
    "scale_drifting": {"signal", "rate", "limit"},
    "delayed": {"signal", "delay"},
    "swapped": {"signal"},
    "daemon_killed": {"standby"},
    "motor_lost": {"corner"},
    "calliper_dead": {"corner"},
    "accumulator_low": {"amount"},
}
"""Of each kind, beside `t` and `duration`."""
_BY_PROCESS: Final = {"bus_off", "daemon_killed"}
"""Kinds that the rig causes from outside of the vehicle, at a time that is known beforehand."""
_CONDITION: Final = re.compile(r"(?P<signal>\w+)\s*(?P<sign>[<>])\s*(?P<value>[-+]?\d+(\.\d*)?)")
_NEEDED: Final = {"delay", "signal", "amount", "rate", "limit"}

LONGEST_DELAY: Final = 21  # cycles
FAULT: Final = np.dtype(
    [
        ("kind", "i4"),
        ("begin", "f8"),  # s, inf: its condition did not hold yet
        ("end", "f8"),
        ("soonest", "f8"),  # s
        ("duration", "f8"),
        ("watched", "i4"),  # input of its condition, -1: none
        ("sign", "f8"),  # 1: begins above `threshold`, -1: below
        ("threshold", "f8"),
        ("share", "f8"),
        ("delay", "f8"),
        ("amount", "f8"),
        ("ids", "u4", (32,)),
        ("n_ids", "i4"),
        ("place", "u1", (N_INPUTS,)),  # 1: this input is disturbed
        ("held", "f8", (N_INPUTS,)),  # NaN: no value held
        ("rate", "f8"),
        ("limit", "f8"),
        ("past", "f8", (LONGEST_DELAY, N_INPUTS)),  # values of the last cycles, a ring
        ("newest", "i8"),  # its row
        ("corner", "u1", (4,)),
        ("standby", "u1"),
    ],
    align=True,
)


@cache
def _messages() -> dict[str, dict[str, int]]:
    """Return identifiers by name, of the vehicle and of the ECU."""
    named: dict[str, dict[str, int]] = {}
    senders: tuple[Literal["Vehicle", "BrakeEcu"], ...] = ("Vehicle", "BrakeEcu")
    for sender in senders:
        plan = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), sender)
        named[sender] = dict(zip(plan.messages["name"].tolist(), plan.ids.tolist(), strict=True))
    return named


class Fault(BaseModel):
    """A fault; docs/rig.md has the keys and the effect of each kind."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, json_schema_extra=describe_keys
    )

    kind: Kind
    """What fails."""
    t: Annotated[float, Field(ge=0.0), Unit("s")]
    """Since the car set off; with `when` at the soonest."""
    when: str = ""
    """Condition by which it begins, as `vehicle_speed < 15`: of an input before faults, in its unit."""
    duration: Annotated[float, Field(gt=0.0), Unit("s")] | None = None
    """Without it to the end of the drive."""
    message: list[str] = []
    """Frames of these messages; none named: all of the vehicle."""
    share: Annotated[float, Field(gt=0.0, le=1.0), Unit("-")] = 1.0
    """Of these frames, drawn."""
    delay: Annotated[float, Field(gt=0.0, le=0.2), Unit("s")] = 0.0
    """Of late frames, of a delayed signal; between the batches of a gateway."""
    signal: list[str] = []
    """Inputs that are disturbed."""
    amount: float = 0.0
    """Value, addition or standard deviation in the signal's unit; factor; the accumulator's pressure, bar."""
    rate: float = 0.0
    """Of a drift, in the signal's unit per second, or relative per second."""
    limit: Annotated[float, Field(gt=0.0)] = math.inf
    """Greatest size of a drift."""
    corner: list[Literal["fl", "fr", "rl", "rr"]] = ["fl", "fr", "rl", "rr"]
    """Wheels whose motor or calliper fails."""
    standby: bool = False
    """A second daemon stands by."""

    @model_validator(mode="after")
    def _complete(self) -> "Fault":
        belongs = KEYS[self.kind]
        given = self.model_fields_set - {"kind", "t", "duration", "when"}
        for name in sorted(given - belongs):
            raise ValueError(f"{name} does not belong to the kind {self.kind!r}; remove it")
        for name in sorted(belongs & _NEEDED - given):
            raise ValueError(f"the kind {self.kind!r} needs {name}")
        if self.when and self.kind in _BY_PROCESS:
            raise ValueError(f"when does not belong to the kind {self.kind!r}; give t alone")
        if self.when:
            _condition(self.when)
        known = _messages()
        for name in self.message:
            if not any(name in of_sender for of_sender in known.values()):
                raise ValueError(f"message: no {name!r} in the database")
        for name in self.signal:
            if not _places(name):
                raise ValueError(f"signal: {name!r} is none of the ECU's inputs")
        if self.kind == "swapped" and [len(_places(name)) for name in self.signal] != [1, 1]:
            raise ValueError("signal: swapped are two signals of one wheel each; name both")
        return self

    @property
    def end(self) -> float:
        """End of the fault [s], inf: never."""
        return math.inf if self.duration is None else self.t + self.duration

    def ids(self) -> list[int]:
        """Return the identifiers of the frames that it disturbs."""
        vehicle, unit = _messages()["Vehicle"], _messages()["BrakeEcu"]
        if self.kind == "bus_off":
            return [*vehicle.values(), *unit.values()]
        if self.message:
            return [{**vehicle, **unit}[name] for name in self.message]
        return list(vehicle.values())


def _places(name: str) -> list[int]:
    """Return the inputs of that name; a name without a corner means all four."""
    names = (name, *(f"{name}_{corner}" for corner in CORNERS))
    return [INPUT[one] for one in names if one in INPUT]


class Condition(NamedTuple):
    """Condition by which a fault begins."""

    watched: int = -1
    """Input, -1: none."""
    sign: float = 1.0
    """1: above the threshold, -1: below."""
    threshold: float = 0.0


def _condition(text: str) -> Condition:
    """Return the condition in `text`, as `vehicle_speed < 15`. Raises ValueError if it is none."""
    found = _CONDITION.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"when: {text!r} is no condition; write it as vehicle_speed < 15")
    if len(places := _places(found["signal"])) != 1:
        raise ValueError(f"when: {found['signal']!r} is not one of the ECU's inputs; name one of one wheel")
    return Condition(places[0], 1.0 if found["sign"] == ">" else -1.0, float(found["value"]))


def begun(faults: Sequence[Fault], t: Vector, acting: Vector) -> list[Fault]:
    """Return the faults with `t` when they began, inf: never.

    `acting` are the masks of acting faults at `t` [s] (`fault_acting` of the truth), shape (n,).
    """
    masks = np.nan_to_num(acting).astype(np.int64)
    began = list(faults)
    for place, fault in enumerate(faults):
        if fault.when:
            rows = np.flatnonzero(masks >> place & 1)
            began[place] = fault.model_copy(update={"t": float(t[rows[0]]) if len(rows) else math.inf})
    return began


def fault_records(faults: Sequence[Fault]) -> RecordArray:
    """Return the faults for the kernels, `FAULT`, shape (n,)."""
    rows = new_record(FAULT, len(faults))
    for row, fault in zip(rows, faults, strict=True):
        row["kind"], row["begin"], row["end"] = KINDS.index(fault.kind), fault.t, fault.end
        row["soonest"], row["duration"] = fault.t, fault.end - fault.t
        condition = _condition(fault.when) if fault.when else Condition()
        row["watched"], row["sign"], row["threshold"] = condition
        if fault.when:
            row["begin"] = row["end"] = math.inf
        row["share"], row["delay"], row["amount"] = fault.share, fault.delay, fault.amount
        ids = fault.ids()
        row["ids"][: len(ids)], row["n_ids"] = ids, len(ids)
        for name in fault.signal:
            row["place"][_places(name)] = 1
        row["rate"], row["limit"] = fault.rate, fault.limit
        row["held"] = row["past"] = np.nan
        row["corner"] = [corner in fault.corner for corner in CORNERS]
        row["standby"] = fault.standby
    return rows
