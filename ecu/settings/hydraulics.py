"""The hydraulic unit as CONFIG has it: `[hydraulics]`."""

from typing import Annotated, Any, Final, NamedTuple

from pydantic import Field

from ecu.algorithm.hydraulics import CYCLE, LONGEST_DEAD_TIME
from ecu.settings.toml_file import Section, Unit


class Answer(NamedTuple):
    """Second-order answer of a pressure to its demand."""

    inertia: float
    """s^2"""
    lag: float
    """s"""
    dead_time: float
    """s"""


BUILD_UP: Final = Answer(0.00075, 0.037, 0.026)
"""(A.17)"""
RELEASE: Final = Answer(0.00021, 0.045, 0.015)
"""(A.18)"""
USUAL_STEP: Final = 20.0  # bar, that a limit of the rate makes late. Assumption
UNLIMITED: Final = 18000.0  # bar/s

DeadTime = Annotated[float, Field(ge=CYCLE, le=LONGEST_DEAD_TIME), Unit("s")]
Lag = Annotated[float, Field(ge=0.005, le=1.0), Unit("s")]
PressureRate = Annotated[float, Field(ge=20.0, le=UNLIMITED), Unit("bar/s")]


class Hydraulics(Section):
    """How the calliper pressures follow their demands; the thesis's unit unless given."""

    dead_time_rise: DeadTime = BUILD_UP.dead_time
    """From a demand that rises to the pressure, s (A.17); counts in steps of 5 ms."""
    dead_time_fall: DeadTime = RELEASE.dead_time
    """From a demand that falls to the pressure, s (A.18)."""
    lag_rise: Lag = BUILD_UP.lag
    """Lateness of the pressure beside a steady rise, without the dead time, s (A.17)."""
    lag_fall: Lag = RELEASE.lag
    """The same beside a steady fall, s (A.18)."""
    rise_limit: PressureRate = UNLIMITED
    """Greatest rate of a rising pressure; the largest value is all of it in one cycle: none."""
    fall_limit: PressureRate = UNLIMITED
    """The same of a falling one."""

    @property
    def lateness(self) -> float:
        """Return by how much a rise of `USUAL_STEP` is late [s]."""
        return self.dead_time_rise + self.lag_rise + 0.5 * USUAL_STEP / self.rise_limit


def set_hydraulics(row: Any, unit: Hydraulics) -> None:
    """Write the hydraulic unit into `row`, one `PARAMS`; the shape of a step stays that of the thesis's."""
    row["dead_time"] = unit.dead_time_rise, unit.dead_time_fall
    row["pressure_lag"] = unit.lag_rise, unit.lag_fall
    row["pressure_inertia"] = [
        usual.inertia * (lag / usual.lag) ** 2
        for usual, lag in ((BUILD_UP, unit.lag_rise), (RELEASE, unit.lag_fall))
    ]
    row["pressure_rate"] = unit.rise_limit, unit.fall_limit
    row["slowness"] = unit.lateness / Hydraulics().lateness
