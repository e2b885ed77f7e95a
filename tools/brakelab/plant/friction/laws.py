"""All friction laws: their numbers, and the kernel that dispatches to them."""

from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from brakelab.plant.friction import (
    constant,
    ilvo,
    ilvo_bounded,
    network,
    ostermeyer,
    ostermeyer_revised,
    own,
    quadratic,
    static_lugre,
    surface,
    table,
)
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.ilvo import Ilvo
from brakelab.plant.friction.ilvo_bounded import IlvoBounded
from brakelab.plant.friction.law import ROW, Law, RigBrake
from brakelab.plant.friction.network import Network
from brakelab.plant.friction.ostermeyer import Ostermeyer
from brakelab.plant.friction.ostermeyer_revised import OstermeyerRevised
from brakelab.plant.friction.own import Own
from brakelab.plant.friction.quadratic import Quadratic
from brakelab.plant.friction.static_lugre import StaticLugre
from brakelab.plant.friction.surface import Surface
from brakelab.plant.friction.table import Table
from brakelab.plant.jit import Record, kernel

LAWS: Final[tuple[type[Law], ...]] = (
    IlvoBounded,
    Ilvo,
    Ostermeyer,
    OstermeyerRevised,
    Constant,
    Table,
    Surface,
    Quadratic,
    StaticLugre,
    Network,
    Own,
)
AnyLaw = Annotated[
    IlvoBounded
    | Ilvo
    | Ostermeyer
    | OstermeyerRevised
    | Constant
    | Table
    | Surface
    | Quadratic
    | StaticLugre
    | Network
    | Own,
    Field(discriminator="law"),
]


def law_row(law: Law, brake: RigBrake) -> tuple[int, NDArray[np.float64]]:
    """Return the law's number, as used by `friction`, and its row of `ROW` numbers."""
    given = law.row(brake)
    row = np.zeros(ROW)
    row[: len(given)] = given
    return LAWS.index(type(law)), row


@kernel
def friction(
    law: int,
    row: Record,
    memory: float,
    pressure: float,
    speed: float,
    slowing: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """Return memory and mu_b of the law numbered `law`, `dt` [s] later; see the package for the inputs."""
    if law == 0:
        return ilvo_bounded.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 1:
        return ilvo.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 2:
        return ostermeyer.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 3:
        return ostermeyer_revised.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 4:
        return constant.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 5:
        return table.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 6:
        return surface.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 7:
        return quadratic.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 8:
        return static_lugre.step(row, memory, pressure, speed, slowing, temperature, dt)
    if law == 9:
        return network.step(row, memory, pressure, speed, slowing, temperature, dt)
    return own.step(row, memory, pressure, speed, slowing, temperature, dt)
