"""Faults that somebody types while the simulated car drives: `brake-ecu vehicle … --by-hand`.

A line is a kind and its keys as in a `[[fault]]` of a scenario, lists with commas: `lost message=Imu,Steering
duration=2`. It begins when it comes, with `t` so many seconds later, with `when` by a condition. `off` ends
what was typed.
"""

import shlex
from collections import deque
from collections.abc import Iterable
from threading import Thread
from typing import Final

import numpy as np
from pydantic import ValidationError

from brakelab.simulation.faults import Fault, fault_records
from brakelab.simulation.vehicle_bus import Vehicle
from ecu.contract.records import RecordArray
from ecu.errors import UserError
from ecu.output import say
from ecu.settings.toml_file import describe

ROOM: Final = 8
"""Faults by hand at a time; one more replaces the oldest."""
OFF: Final = "off"
_LISTS: Final = ("message", "signal", "corner")
_NEVER: Final = float("inf")


def with_room(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with room for faults by hand behind its own."""
    return vehicle._replace(faults=np.concatenate([vehicle.faults, _none()]))


def _none() -> RecordArray:
    rows = fault_records([Fault(kind="lost", t=0.0)] * ROOM)
    rows["begin"] = rows["end"] = _NEVER
    return rows


def typed(line: str) -> RecordArray:
    """Return the fault of a line, `FAULT`, shape (1,), its times from now. Raises UserError if it is none."""
    try:
        kind, *pairs = shlex.split(line)
    except ValueError as error:
        raise UserError("fault", line, f"{error}; close it") from None
    given: dict[str, object] = {"t": 0.0, "kind": kind}
    for pair in pairs:
        key, sign, value = pair.partition("=")
        if not sign:
            raise UserError("fault", pair, "is no KEY=VALUE, as in: lost message=Imu duration=2")
        given[key] = value.split(",") if key in _LISTS else value
    try:
        fault = Fault.model_validate(given)
    except ValidationError as error:
        raise describe(error, "fault", Fault) from None
    if fault.kind == "daemon_killed":
        raise UserError("fault", fault.kind, "a car cannot do that; kill the daemon")
    return fault_records([fault])


class Hand:
    """Faults by hand of one vehicle; a thread beside its loop reads them."""

    def __init__(self, vehicle: Vehicle, lines: Iterable[str]) -> None:
        """`vehicle`: one of `with_room`."""
        self._rows, self._next = vehicle.faults[-ROOM:], 0
        self._asked: deque[tuple[str, RecordArray | None]] = deque()
        self._reader = Thread(target=self._read, args=(lines,), daemon=True)
        self._reader.start()

    def _read(self, lines: Iterable[str]) -> None:
        for line in map(str.strip, lines):
            try:
                if line:
                    self._asked.append((line, None if line == OFF else typed(line)))
            except UserError as error:
                say(str(error))

    def take(self, t: float) -> None:
        """Let begin what was typed since the last cycle; `t` [s] since the car set off."""
        while self._asked:
            line, fault = self._asked.popleft()
            if fault is None:
                self._rows[:] = _none()
            else:
                for time in ("begin", "end", "soonest"):
                    fault[time] += t
                self._rows[self._next] = fault[0]
                self._next = (self._next + 1) % ROOM
            print(f"{t:.2f} s: {line}", flush=True)
