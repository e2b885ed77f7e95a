"""Fault injection: `[[fault]]` tables of a scenario, and the kernels that apply them.

```
[[fault]]
kind = "lost"                # see `KINDS`
t = 4.0                      # s since the car set off
duration = 1.0               # s; without it to the end of the drive
message = ["Imu"]            # of the database, either way; without it all frames of the vehicle
share = 0.5                  # of these frames
```
| kind | keys beside t and duration | effect |
| --- | --- | --- |
| lost, doubled, corrupted | message, share | frames are lost, arrive twice, arrive with one bit flipped |
| late | message, share, delay [s] | frames arrive `delay` later |
| stuck | signal | a signal on the bus keeps its value, its frames continue |
| invalid | signal | a signal is sent as not available |
| biased, noisy | signal, amount | `amount` is added; white noise of that standard deviation is added |
| bus_off | | the ECU's controller is off the bus: neither side receives the other |
| daemon_killed | standby | SIGKILL at `t`, restart after `duration`; `standby`: a second daemon stands by |
| motor_lost | corner | motors give no torque and report none available |
| calliper_dead | corner | callipers get no pressure: one, or those of a circuit |
| accumulator_low | amount [bar] | the hydraulics reach this pressure at most and report "not ready" |

Frames are disturbed in transit, after end-to-end protection; a signal is disturbed before it, so that its
frame is intact.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, Final, Literal, NamedTuple, get_args

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ecu.bus.transmit import contract_transmit_plan
from ecu.contract import signals
from ecu.contract.records import FRAME, RecordArray, new_record
from ecu.contract.signals import CORNERS, INPUT, N_INPUTS
from ecu.jit import Record, kernel
from ecu.settings.resources import resource
from ecu.settings.toml_file import Unit

Kind = Literal[
    "late",
    "lost",
    "doubled",
    "corrupted",
    "stuck",
    "invalid",
    "biased",
    "noisy",
    "bus_off",
    "daemon_killed",
    "motor_lost",
    "calliper_dead",
    "accumulator_low",
]
KINDS: Final[tuple[str, ...]] = get_args(Kind)
LATE, LOST, DOUBLED, CORRUPTED, STUCK, INVALID, BIASED, NOISY, BUS_OFF, DAEMON_KILLED = range(10)
MOTOR_LOST, CALLIPER_DEAD, ACCUMULATOR_LOW = range(10, len(KINDS))
_FRAMES: Final = {"message", "share"}
_BELONGS: Final[dict[str, set[str]]] = {
    "late": {*_FRAMES, "delay"},
    "lost": _FRAMES,
    "doubled": _FRAMES,
    "corrupted": _FRAMES,
    "stuck": {"signal"},
    "invalid": {"signal"},
    "biased": {"signal", "amount"},
    "noisy": {"signal", "amount"},
    "bus_off": set(),
    "daemon_killed": {"standby"},
    "motor_lost": {"corner"},
    "calliper_dead": {"corner"},
    "accumulator_low": {"amount"},
}
_NEEDED: Final = {"delay", "signal", "amount"}

FAULT: Final = np.dtype(
    [
        ("kind", "i4"),
        ("begin", "f8"),  # s
        ("end", "f8"),
        ("share", "f8"),
        ("delay", "f8"),
        ("amount", "f8"),
        ("ids", "u4", (32,)),
        ("n_ids", "i4"),
        ("place", "u1", (N_INPUTS,)),  # 1: this input is disturbed
        ("held", "f8", (N_INPUTS,)),  # NaN: no value held
        ("corner", "u1", (4,)),
        ("standby", "u1"),
    ],
    align=True,
)
SLACK: Final = 1e-4  # s by which the sum of all steps may fall short of a cycle's time
HELD: Final = 256  # delayed frames at a time
ROOM: Final = 512  # frames that arrive in one cycle


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
    """One `[[fault]]` table."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)

    kind: Kind
    """What fails; docs/rig.md has the effect of each."""
    t: Annotated[float, Field(ge=0.0), Unit("s")]
    """Since the car set off."""
    duration: Annotated[float, Field(gt=0.0), Unit("s")] | None = None
    """Without it to the end of the drive."""
    message: list[str] = []
    """Frames of these messages; none named: all of the vehicle."""
    share: Annotated[float, Field(gt=0.0, le=1.0), Unit("-")] = 1.0
    """Of these frames, drawn."""
    delay: Annotated[float, Field(gt=0.0, le=0.2), Unit("s")] = 0.0
    """Of late frames."""
    signal: list[str] = []
    """Inputs that are disturbed."""
    amount: float = 0.0
    """Added, or standard deviation of the noise, in the signal's unit; the accumulator's pressure, bar."""
    corner: list[Literal["fl", "fr", "rl", "rr"]] = ["fl", "fr", "rl", "rr"]
    """Wheels whose motor or calliper fails."""
    standby: bool = False
    """A second daemon stands by."""

    @model_validator(mode="after")
    def _complete(self) -> "Fault":
        belongs = _BELONGS[self.kind]
        given = self.model_fields_set - {"kind", "t", "duration"}
        for name in sorted(given - belongs):
            raise ValueError(f"{name} does not belong to the kind {self.kind!r}; remove it")
        for name in sorted(belongs & _NEEDED - given):
            raise ValueError(f"the kind {self.kind!r} needs {name}")
        known = _messages()
        for name in self.message:
            if not any(name in of_sender for of_sender in known.values()):
                raise ValueError(f"message: no {name!r} in the database")
        for name in self.signal:
            if not _places(name):
                raise ValueError(f"signal: {name!r} is none of the ECU's inputs")
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


def fault_records(faults: Sequence[Fault]) -> RecordArray:
    """Return the faults for the kernels, `FAULT`, shape (n,)."""
    rows = new_record(FAULT, len(faults))
    for row, fault in zip(rows, faults, strict=True):
        row["kind"], row["begin"], row["end"] = KINDS.index(fault.kind), fault.t, fault.end
        row["share"], row["delay"], row["amount"] = fault.share, fault.delay, fault.amount
        ids = fault.ids()
        row["ids"][: len(ids)], row["n_ids"] = ids, len(ids)
        for name in fault.signal:
            row["place"][_places(name)] = 1
        row["held"] = np.nan
        row["corner"] = [corner in fault.corner for corner in CORNERS]
        row["standby"] = fault.standby
    return rows


class Link(NamedTuple):
    """One direction of the bus."""

    held: RecordArray
    """`FRAME`s that come later, and when:"""
    release: NDArray[np.float64]
    """s, inf where nothing is held."""
    arrived: RecordArray
    """Room for what `deliver` hands over."""


def new_link() -> Link:
    """Return a link without delayed frames."""
    return Link(new_record(FRAME, HELD), np.full(HELD, np.inf), new_record(FRAME, ROOM))


@kernel
def is_on(fault: Record, t: float) -> bool:
    """Return whether the fault acts at `t` [s]."""
    return bool(fault.begin <= t + SLACK < fault.end)


@kernel
def _hits(fault: Record, can_id: int, t: float, noise: Generator) -> bool:
    if not is_on(fault, t):
        return False
    for i in range(fault.n_ids):
        if fault.ids[i] == can_id:
            return bool(fault.share >= 1.0 or noise.random() < fault.share)
    return False


@kernel
def _hold_up(link: Link, frame: Record, release: float, delay: float) -> None:
    for place in range(len(link.release)):
        if math.isinf(link.release[place]):
            link.held[place] = frame
            link.held[place].stamp_ns += np.int64(1e9 * delay)
            link.release[place] = release
            return


@kernel
def deliver(faults: Any, link: Link, t: float, noise: Generator, frames: Any, count: int) -> int:
    """Write the frames that arrive into `link.arrived`: of `frames[:count]`, sent at `t` [s], and of delayed
    ones; return their number."""
    arrived = 0
    for place in range(len(link.release)):
        if link.release[place] <= t + SLACK:
            link.arrived[arrived] = link.held[place]
            link.release[place] = np.inf
            arrived += 1
    for i in range(count):
        kept, copies = True, 1
        link.arrived[arrived] = frames[i]
        for j in range(len(faults)):
            fault = faults[j]
            kind = fault.kind
            if kind != LOST and kind != BUS_OFF and kind != LATE and kind != DOUBLED and kind != CORRUPTED:
                continue
            if not _hits(fault, frames[i].can_id, t, noise):
                continue
            if kind == CORRUPTED:
                bit = int(noise.random() * 8 * frames[i].length)
                link.arrived[arrived].data[bit // 8] ^= 1 << (bit % 8)
            elif kind == DOUBLED:
                copies = 2
            else:
                kept = False
                if kind == LATE:
                    _hold_up(link, frames[i], t + fault.delay, fault.delay)
        if kept:
            arrived += 1
            if copies == 2:
                link.arrived[arrived] = link.arrived[arrived - 1]
                arrived += 1
    return arrived


@kernel
def _spoil_signals(fault: Record, on: bool, noise: Generator, values: NDArray[np.float64]) -> None:
    for place in range(len(fault.place)):
        if not fault.place[place]:
            continue
        if not on:
            fault.held[place] = np.nan
        elif fault.kind == INVALID:
            values[place] = np.nan
        elif fault.kind == BIASED:
            values[place] += fault.amount
        elif fault.kind == NOISY:
            values[place] += fault.amount * noise.standard_normal()
        elif math.isnan(fault.held[place]):
            fault.held[place] = values[place]
        elif not math.isnan(values[place]):
            values[place] = fault.held[place]


@kernel
def spoil_car(
    faults: Any, t: float, noise: Generator, sound: Record, params: Record, values: NDArray[np.float64]
) -> None:
    """Apply faults of sensors and actuators to the values to send, shape (N_INPUTS,), and to the car.

    `sound` are the car's parameters without a fault.
    """
    for i in range(4):
        params.motor_share[i] = sound.motor_share[i]
        params.pressure_limit[i] = sound.pressure_limit[i]
    for j in range(len(faults)):
        fault = faults[j]
        on = is_on(fault, t)
        if fault.kind == STUCK or fault.kind == INVALID or fault.kind == BIASED or fault.kind == NOISY:
            _spoil_signals(fault, on, noise, values)
        elif on and fault.kind == MOTOR_LOST:
            for i in range(4):
                if fault.corner[i]:
                    params.motor_share[i] = 0.0
        elif on and fault.kind == CALLIPER_DEAD:
            for i in range(4):
                if fault.corner[i]:
                    params.pressure_limit[i] = 0.0
        elif on and fault.kind == ACCUMULATOR_LOW:
            for i in range(4):
                params.pressure_limit[i] = min(params.pressure_limit[i], 1e5 * fault.amount)
            values[signals.ACCUMULATOR_PRESSURE] = fault.amount
            values[signals.HYDRAULIC_READY] = 0.0
