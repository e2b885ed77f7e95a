"""Expectations: `[[expect]]` tables of a scenario, what its run has to show. docs/rig.md lists them.

`brakelab.rig.verdicts` judges them.
"""

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from brakelab.simulation.scenario_tables import NotNegative, ScenarioTable
from ecu.contract.faults import FAULTS, Fault
from ecu.errors import closest
from ecu.settings.toml_file import Unit

What = Literal[
    "bit",
    "no_bit",
    "mode",
    "recovered",
    "stopping_distance",
    "stopping_time",
    "longer_stop",
    "friction_error",
    "decel_error",
]
_SINCE: Final = {"t", "fault"}
_LIMITS: Final = {"at_most", "at_least"}
KEYS: Final[dict[str, set[str]]] = {
    "bit": {"bit", "within", *_SINCE},
    "no_bit": {"bit", "t"},
    "mode": {"mode", "within", *_SINCE},
    "recovered": {"within", "fault"},
    "stopping_distance": _LIMITS,
    "stopping_time": _LIMITS,
    "longer_stop": _LIMITS,
    "friction_error": {"axle", "at_most"},
    "decel_error": {"at_most"},
}
"""Of each `what`."""
_OPTIONAL: Final[dict[str, set[str]]] = {"mode": {"within"}}
"""Of those that are not in `_SINCE` or `_LIMITS`."""
UNITS: Final = {
    "stopping_distance": "m",
    "stopping_time": "s",
    "longer_stop": "%",
    "friction_error": "%",
    "decel_error": "m/s²",
}
"""Of `at_most` and `at_least`."""
_NUMBERED: Final = {one.bit.bit_length() - 1: one for one in FAULTS}
_NAMED: Final = {one.name: one for one in FAULTS}


class Expectation(ScenarioTable):
    """What a run has to show; docs/rig.md has the keys and the meaning of each `what`."""

    what: What
    """What is looked at."""
    bit: Annotated[int, Field(ge=0, le=max(_NUMBERED)), Unit("-")] | str | None = None
    """Fault bit, by its name or number in docs/faults.md."""
    mode: Literal["starting", "ready", "active", "degraded", "failed"] | None = None
    """Of the ECU."""
    t: Annotated[NotNegative, Unit("s")] | None = None
    """Since the car set off."""
    fault: Annotated[int, Field(ge=1), Unit("-")] = 1
    """Number of the `[[fault]]` from which `within` counts, if `t` is not given."""
    within: Annotated[NotNegative, Unit("s")] | None = None
    """After `t`, or after the fault begins; recovery: after it ends."""
    axle: Literal["front", "rear"] | None = None
    """Whose friction."""
    at_most: float | None = None
    """In the unit of `what`."""
    at_least: float | None = None
    """In the unit of `what`."""

    @model_validator(mode="after")
    def _complete(self) -> "Expectation":
        belongs = KEYS[self.what]
        given = self.model_fields_set - {"what"}
        for name in sorted(given - belongs):
            raise ValueError(f"{name} does not belong to {self.what!r}; remove it")
        for name in sorted(belongs - _SINCE - _LIMITS - _OPTIONAL.get(self.what, set()) - given):
            raise ValueError(f"{self.what!r} needs {name}")
        if belongs & _LIMITS and not given & _LIMITS:
            raise ValueError(f"{self.what!r} needs {' or '.join(sorted(belongs & _LIMITS, reverse=True))}")
        if given >= _SINCE:
            raise ValueError("give either t or fault")
        if self.what == "mode" and self.within is None and self.t is None:
            raise ValueError("'mode' needs t, or within")
        if self.bit is not None and self.bit not in _NAMED | _NUMBERED:
            hint = closest(str(self.bit), _NAMED)
            raise ValueError(f"bit: no fault {self.bit!r}{hint or '; docs/faults.md lists them'}")
        return self

    @property
    def after_fault(self) -> bool:
        """Whether it speaks of a `[[fault]]`."""
        return self.what == "longer_stop" or ("fault" in KEYS[self.what] and self.t is None)

    @property
    def fault_bit(self) -> Fault:
        """The bit of `bit`, which is given."""
        assert self.bit is not None
        return (_NAMED | _NUMBERED)[self.bit]

    @property
    def text(self) -> str:
        """One line without its verdict."""
        since = f"of fault {self.fault}" if self.t is None else f"of t = {self.t:g} s"
        match self.what:
            case "bit":
                return f"{self.fault_bit.name} within {self.within:g} s {since}"
            case "no_bit":
                since = "" if self.t is None else f" from t = {self.t:g} s on"
                return f"never {self.fault_bit.name}{since}"
            case "mode" if self.within is None:
                return f"{self.mode} at t = {self.t:g} s"
            case "mode":
                return f"{self.mode} within {self.within:g} s {since}"
            case "recovered":
                return f"recovered within {self.within:g} s after fault {self.fault}"
        name = " ".join([*([self.axle] if self.axle else []), self.what.replace("_", " ")])
        limits = (("at least", self.at_least), ("at most", self.at_most))
        bounds = " and ".join(f"{side} {limit:g}" for side, limit in limits if limit is not None)
        return f"{name} {bounds} {UNITS[self.what]}"
