"""Entries of this project: the ECU's observers as a shadow, the configured constant, a running average."""

from typing import Any, Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.signal_file import freshness_at_any_rate
from brakelab.simulation.closed_loop import START_NS
from brakelab.simulation.configured import with_observer
from brakelab.studies.entries.inputs import Inputs
from brakelab.studies.entries.observer import Observer
from ecu.algorithm.step import new_state, step
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.records import INPUTS, OUTPUTS, new_record
from ecu.contract.signals import INPUT_SIGNALS
from ecu.jit import kernel
from ecu.recording.learned_range import out_of_range
from ecu.settings.config import Config, new_params


@kernel
def _hear(inputs: Any, freshness: Any, t_ns: int, dt_ns: int, values: Vector) -> None:
    """Take the samples of one cycle, NaN: none."""
    begin_cycle(inputs[0], t_ns, dt_ns)
    for place in range(len(values)):
        if not np.isnan(values[place]):
            accept(inputs[0], freshness, place, values[place], t_ns, True)
    end_cycle(inputs[0], freshness)


class EcuObserver:
    """The whole ECU as a shadow: it hears what every entry hears, and its demands go nowhere.

    Between drives it keeps what the state store would.
    """

    kind = "joint"
    wheel_transducers = False

    def reset(self, config: Config) -> None:
        """Begin with nothing learned."""
        self._params = new_params(with_observer(config, self.kind))
        self._params["transmit"] = False
        self._state, self._ran = new_state(self._params), False
        self._outputs = new_record(OUTPUTS)

    def step(self, inputs: Inputs) -> tuple[Vector, Vector]:
        """Return friction and sigma after one cycle of the ECU."""
        if inputs.t == 0.0:
            self._begin(inputs.signals)
        t_ns = START_NS + round(1e9 * inputs.t)
        _hear(self._inputs, self._freshness, t_ns, round(1e9 * inputs.dt), inputs.values)
        step(self._params, self._state, self._inputs, self._outputs)
        row = self._outputs[0]
        return row["mu_b"].copy(), row["sigma_mu_b"].copy()

    def _begin(self, signals: frozenset[str]) -> None:
        learned = self._state["learned"].copy() if self._ran else None
        if learned is not None and out_of_range(learned, self._params["mu_nominal"][0]):
            learned = None
        self._params["mapped"] = [signal.name in signals for signal in INPUT_SIGNALS]
        self._state, self._ran = new_state(self._params, learned), True
        self._inputs, self._freshness = new_record(INPUTS), freshness_at_any_rate()

    @property
    def mass(self) -> float:
        """As learned [kg]."""
        return float(self._outputs["vehicle_mass"][0])

    @property
    def overrun(self) -> float:
        """Engine drag as learned [m/s^2]."""
        return float(self._outputs["overrun"][0])

    @property
    def pressure_zero(self) -> Vector:
        """As learned [bar], shape (4,)."""
        return np.array(self._outputs["pressure_zero"][0])


class Observer1(EcuObserver):
    """Observer 1 of the thesis, by measured wheel forces."""

    kind = "observer1"
    wheel_transducers = True


class Observer2(EcuObserver):
    """Observer 2 of the thesis."""

    kind = "observer2"


class Configured:
    """The friction of the configuration, for ever."""

    def reset(self, config: Config) -> None:
        """Read it."""
        self._mu = np.array(new_params(config)["mu_nominal"][0])
        self._sigma = np.full(4, np.nan)

    def step(self, inputs: Inputs) -> tuple[Vector, Vector]:
        """Return it."""
        return self._mu, self._sigma


class RunningAverage:
    """Configured friction times the running average of a scale, one value an application.

    The scale is the force that decelerates the configured car, less motors and resistances, over that of the
    linings by configured friction; level road, no zero errors. The average starts with one scale of 1.
    """

    LEAST_FORCE: Final = 0.05
    """Of the car's weight that the linings must take."""
    LOWEST_SPEED: Final = 15.0 / 3.6  # m/s
    FEWEST_SAMPLES: Final = 50  # samples of the accelerometer

    def reset(self, config: Config) -> None:
        """Begin with one scale of 1."""
        self._car: Any = new_params(config)[0]
        self._last = np.zeros(12)  # pressures [bar], wheel speeds [rad/s], motor torques [N m]
        self._force, self._linings, self._samples = 0.0, 0.0, 0
        self._sum, self._count = 1.0, 1
        self._sigma = np.full(4, np.nan)

    def step(self, inputs: Inputs) -> tuple[Vector, Vector]:
        """Return the average of the applications that have ended."""
        car = self._car
        heard = np.concatenate((inputs.calliper_pressure, inputs.wheel_speed, inputs.motor_torque))
        self._last = np.where(np.isnan(heard), self._last, heard)
        pressure, speeds, motors = self._last.reshape(3, 4)
        acts = np.maximum(pressure * BAR - car["push_out_pressure"], 0.0)
        lever = 2.0 * car["piston_area"] * car["effective_radius"] / car["wheel_radius"]
        linings = float((lever * car["mu_nominal"] * acts).sum())
        speed = float((speeds * car["wheel_radius"]).mean())
        if linings > self.LEAST_FORCE * GRAVITY * car["mass"] and speed > self.LOWEST_SPEED:
            if not np.isnan(inputs.accel_x):
                rest = float((motors / car["wheel_radius"]).sum()) + car["drag_area"] * speed**2
                rest += car["rolling_resistance"] * GRAVITY * car["mass"]
                inert = car["mass"] + (car["wheel_inertia"] / car["wheel_radius"] ** 2).sum()
                self._force += -inputs.accel_x * inert - rest
                self._linings += linings
                self._samples += 1
        elif self._samples:
            if self._samples >= self.FEWEST_SAMPLES:
                self._sum, self._count = self._sum + self._force / self._linings, self._count + 1
            self._force, self._linings, self._samples = 0.0, 0.0, 0
        return self._sum / self._count * car["mu_nominal"], self._sigma


OURS: Final[dict[str, type[Observer]]] = {
    "joint observer": EcuObserver,
    "Observer 2": Observer2,
    "Observer 1, measuring wheels": Observer1,
    "running average": RunningAverage,
    "configured": Configured,
}
