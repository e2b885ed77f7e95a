"""Cycle with python-can, cantools and numpy: no checksums, no counters, no time-outs; of the algorithm the
four friction filters and the nominal pressure law alone."""

from collections.abc import Iterable
from typing import Any, Final

import can
import numpy as np
from numpy.typing import NDArray

from brakelab.bench.filters import FILTER_INPUT, NumpyFilters, constants
from ecu.bus.database import load_database
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS
from ecu.settings.resources import resource

SENT: Final = (
    "PressureDemandFront",
    "PressureDemandRear",
    "MotorDemandFront",
    "MotorDemandRear",
    "BlcfRear",
    "DiscTemperature",
)
_FORCE_NOISE: Final = 0.002  # of the slip


def _per_corner(stem: str, values: Iterable[float]) -> dict[str, float]:
    return {f"{stem}_{corner}": float(value) for corner, value in zip(CORNERS, values, strict=True)}


class PythonEcu:
    """One method per stage."""

    def __init__(self, bus: can.BusABC, params: RecordArray, offsets: Iterable[int]) -> None:
        self.bus, self.car = bus, params[0]
        database: Any = load_database(resource("dbc/brake_ecu.dbc"))
        self.known = {m.frame_id + offset: m for offset in offsets for m in database.messages}
        self.sent: list[Any] = [database.get_message_by_name(name) for name in SENT]
        self.const, self.row = constants(params), np.zeros(4, FILTER_INPUT)
        self.stiffness = self.car["slip_stiffness"] * self.car["static_load"]
        self.filters = NumpyFilters(self.const, self.row)
        self.latest: dict[str, float] = {}

    def drain(self) -> list[can.Message]:
        """Return the waiting frames."""
        received = []
        while (message := self.bus.recv(timeout=0)) is not None:
            received.append(message)
        return received

    def receive(self, messages: list[can.Message]) -> None:
        """Decode."""
        for message in messages:
            known = self.known[message.arbitration_id]
            self.latest.update(known.decode(message.data, decode_choices=False))

    def _corners(self, name: str) -> NDArray[np.float64]:
        return np.array([self.latest[f"{name}_{corner}"] for corner in CORNERS])

    def step(self) -> NDArray[np.float64]:
        """Run the filters; return the pressure demands [bar], shape (4,)."""
        car, row, const = self.car, self.row, self.const
        speed = max(self.latest["vehicle_speed"], 1.0)
        row["omega"], row["radius"], row["speed"] = self._corners("wheel_speed"), car["wheel_radius"], speed
        row["pressure"] = np.maximum(1e5 * self._corners("calliper_pressure") - car["push_out_pressure"], 0.0)
        row["load"] = car["static_load"]
        row["force"] = self.stiffness * (row["omega"] * row["radius"] / speed - 1.0)
        row["outer_torque"] = (
            self._corners("motor_torque") + car["rolling_resistance"] * row["load"] * row["radius"]
        )
        row["force_variance"] = (self.stiffness * _FORCE_NOISE) ** 2
        self.filters.cycle(row)
        torque = 0.25 * car["mass"] * self.latest["decel_demand"] * car["wheel_radius"]
        wanted = torque / (const.torque_per_mu * const.mu) + car["push_out_pressure"]
        limited: NDArray[np.float64] = np.clip(1e-5 * wanted, 0.0, 180.0)
        return limited

    def transmit(self, demand: NDArray[np.float64]) -> list[can.Message]:
        """Encode the six messages due."""
        values = {"crc": 0.0, "alive_counter": 0.0, "pressure_demand_valid": 1.0, "motor_demand_valid": 0.0}
        values |= _per_corner("pressure_demand", demand) | _per_corner("motor_demand", [0.0] * 4)
        values |= _per_corner("mu_b", np.clip(self.filters.x[:, 2], 0.2, 0.7))
        values |= _per_corner("sigma_mu_b", [0.03] * 4) | _per_corner("mode", [1.0] * 4)
        values |= _per_corner("disc_temperature", [100.0] * 4)
        return [
            can.Message(
                arbitration_id=message.frame_id,
                is_extended_id=False,
                data=message.encode({signal.name: values[signal.name] for signal in message.signals}),
            )
            for message in self.sent
        ]

    def send(self, messages: list[can.Message]) -> None:
        """Send."""
        for message in messages:
            self.bus.send(message, timeout=0)
