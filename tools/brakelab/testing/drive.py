"""ECU and simulated car of a test, and what it may ask of them: signals with units, faults, fault bits.

In memory both are the closed loop of `brake-ecu simulate`, in real time the processes of `brake-ecu rig`.
"""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import tomlkit
from numpy.typing import NDArray
from pydantic import ValidationError

from brakelab.api import Change, changed, check_seed
from brakelab.given import AnyPath
from brakelab.report.drive import DriveResult, read_drive, start_ns
from brakelab.rig.live import choose_bus
from brakelab.rig.live import drive as drive_on_bus
from brakelab.rig.results import write_recorded
from brakelab.rig.simulated import Driven, drive_in_memory, verdicts
from brakelab.rig.vehicle_node import warm_up
from brakelab.simulation.expectations import Expectation, What
from brakelab.simulation.faults import Fault, Kind
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.vehicle_bus import truth_unit
from brakelab.table import Table
from ecu.arguments import scenario_file
from ecu.bus.units import conversion
from ecu.contract.signals import OUTPUT_SIGNALS, column_names
from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.toml_file import describe
from ecu.warm import warm

OUTPUT_UNITS = {name: signal.unit for signal in OUTPUT_SIGNALS for name in column_names(signal)}


class Signal(NamedTuple):
    """A column of a drive."""

    name: str
    unit: str
    t: NDArray[np.float64]
    """Since the car set off [s], shape (n,)."""
    values: NDArray[np.float64]
    """Shape (n,); NaN: not available."""

    def between(self, begin: float, end: float = math.inf) -> "Signal":
        """Return the rows of a span [s], its end without."""
        rows = (self.t >= begin) & (self.t < end)
        return self._replace(t=self.t[rows], values=self.values[rows])

    def within(self, low: float, high: float, unit: str) -> None:
        """Assert that every row is available and within limits in a unit, as a signal map spells it."""
        __tracebackhide__ = True
        factor, offset = self._from(unit)
        kept = (self.values >= factor * low + offset) & (self.values <= factor * high + offset)
        self._assert(kept, f"within {low:g} to {_said(high, 'g', unit)}", factor, offset, unit)

    def near(self, other: "Signal | float", by: float, unit: str) -> None:
        """Assert that every row is within `by` of another signal, or of a number in this one's unit.

        `unit` is one of a difference; "%": of `other`. Another signal is converted into this one's
        unit; where it has no row, nothing is near. Raises UserError for one of another quantity.
        """
        __tracebackhide__ = True
        aim: Any = self._seen(other) if isinstance(other, Signal) else other
        share = unit == "%"
        limit = 0.01 * by * np.abs(aim) if share else self._from(unit)[0] * by
        target = other.name if isinstance(other, Signal) else _said(other, "g", self.unit)
        self._assert(np.abs(self.values - aim) <= limit, f"within {_said(by, 'g', unit)} of {target}")

    def _seen(self, other: "Signal") -> NDArray[np.float64]:
        __tracebackhide__ = True
        assert len(other.t), f"{other.name}: no row in this span"
        factor, offset = self._from(other.unit)
        return factor * np.interp(self.t, other.t, other.values, math.nan, math.nan) + offset

    def _from(self, unit: str) -> tuple[float, float]:
        return conversion(unit, self.unit, None, "signal", self.name)

    def _assert(
        self,
        kept: NDArray[np.bool_],
        expected: str,
        factor: float = 1.0,
        offset: float = 0.0,
        unit: str | None = None,
    ) -> None:
        __tracebackhide__ = True
        assert len(kept), f"{self.name}: no row in this span"
        if not kept.all():
            first = int(np.argmin(kept))
            found = _said((self.values[first] - offset) / factor, ".4g", unit or self.unit)
            share = f"{np.count_nonzero(~kept)} of {len(kept)} rows"
            raise AssertionError(
                f"{self.name} is {found} at t = {self.t[first]:.2f} s, not {expected} ({share})"
            )


def _said(value: float, digits: str, unit: str) -> str:
    return f"{value:{digits}}" + (f" {unit}" if unit != "-" else "")


def _signal(drive: DriveResult, name: str, unit: str) -> Signal:
    return Signal(name, unit or "-", np.asarray(drive.t), Table(drive.columns, {}).column(name))


class Ecu:
    """The ECU of a test. `ecu["mu_b_fl"]` is an output of the last drive (docs/contract.md)."""

    def __init__(self, config: AnyPath) -> None:
        self.config = config
        self.changes: dict[str, Change] = {}
        """Keys of the configuration with other values, {"control.slip_guard": False}."""
        self._driven: Driven | None = None

    @property
    def driven(self) -> Driven:
        """The last drive. Raises UserError where there is none."""
        if self._driven is None:
            raise UserError("ecu", "", "there is no drive yet; call plant.drive first")
        return self._driven

    @driven.setter
    def driven(self, driven: Driven) -> None:
        self._driven = driven

    @property
    def columns(self) -> list[str]:
        """Names of the outputs of the last drive."""
        return [*self.driven.drive.columns]

    def __getitem__(self, name: str) -> Signal:
        """Return an output. Raises UserError for a name that is none."""
        return _signal(self.driven.drive, name, OUTPUT_UNITS.get(name, ""))

    def reported(self, bit: str | int, within_ms: float, t: float | None = None) -> None:
        """Assert that a bit of docs/faults.md was raised in time after `t` [s], or after the first fault."""
        __tracebackhide__ = True
        self.shows("bit", bit=bit, within=1e-3 * within_ms, **({} if t is None else {"t": t}))

    def shows(self, what: What, **keys: Any) -> None:
        """Assert an expectation, a `what` of docs/rig.md with its keys. Raises UserError for wrong ones."""
        __tracebackhide__ = True
        try:
            expected = Expectation(what=what, **keys)
        except ValidationError as error:
            raise describe(error, "expect", Expectation) from None
        if expected.after_fault and expected.fault > len(self.driven.scenario.fault):
            raise UserError("expect", what, "counts from a fault, and there is none; give t")
        (verdict,) = verdicts(self.driven, [expected])
        assert verdict.passed, verdict.line


class Plant:
    """The simulated car of a test. `plant["mu_b_fl"]` is a true value of the last drive."""

    def __init__(self, ecu: Ecu, folder: Path | None = None) -> None:
        self._ecu, self._faults = ecu, list[dict[str, Any]]()
        self._folder = folder
        """For files of processes; None: in memory."""

    @property
    def columns(self) -> list[str]:
        """Names of the true values of the last drive."""
        return [*self._ecu.driven.truth.columns]

    def __getitem__(self, name: str) -> Signal:
        """Return a true value. Raises UserError for a name that is none."""
        return _signal(self._ecu.driven.truth, name, truth_unit(name))

    def fault(self, kind: Kind, **keys: Any) -> None:
        """Let the next drives have a fault, a `kind` of docs/rig.md with its keys, beside the scenario's.

        Raises:
            UserError: kind or keys are wrong.
        """
        try:
            self._faults.append(Fault(kind=kind, **keys).model_dump(exclude_unset=True))
        except ValidationError as error:
            raise describe(error, "fault", Fault) from None

    def drive(self, scenario: AnyPath | Mapping[str, Any], *, seed: int = 0, **keys: Any) -> None:
        """Drive a scenario to its end: a file, a shipped name, or its content; `keys` go before its own.

        `seed`: of the car and of its noise.

        Raises:
            UserError: the scenario or the configuration is not right.
            RunFault: a process ended early.
        """
        check_seed(seed)
        content = self._content(scenario) | keys
        if isinstance(given := content.get("fault", []), list | tuple):
            content["fault"] = [*given, *self._faults]
        try:
            asked = Scenario.model_validate(content)
        except ValidationError as error:
            raise describe(error, "scenario", Scenario) from None
        with changed(self._ecu.config, self._ecu.changes) as config:
            if self._folder is not None:
                self._ecu.driven = _in_real_time(asked, config, seed, self._folder)
                return
            self._ecu.driven = drive_in_memory(asked, load_config(config), seed)

    def _content(self, scenario: AnyPath | Mapping[str, Any]) -> dict[str, Any]:
        if isinstance(scenario, Mapping):
            return dict(scenario)
        return load_scenario(scenario_file(os.fspath(scenario))).model_dump(exclude_unset=True)


def _in_real_time(scenario: Scenario, config: Path, seed: int, folder: Path) -> Driven:
    path, bus = folder / "scenario.toml", choose_bus()
    if bus.interface == "virtual":
        pytest.skip(bus.why)
    path.write_text(tomlkit.dumps(scenario.model_dump(mode="json", exclude_unset=True)), "utf-8")
    warm_up(scenario)
    warm()
    vehicle = load_config(config)
    try:
        recorded = drive_on_bus(bus, path, config, scenario.fault, folder, seed)
    finally:
        bus.close()
    drive = read_drive(write_recorded(recorded.recordings, vehicle, folder).result, (), "")
    truth = read_drive(recorded.truth, (), "")
    since = 1e-9 * ((start_ns(drive) or 0) - (start_ns(truth) or 0))
    own = drive._replace(t=drive.t + since, metadata={})
    return Driven(scenario, vehicle, seed, own, truth._replace(metadata={}), recorded.truth)
