"""Friction from a network of two hidden layers, 8 and 6 sigmoids, and a linear output (2.4.2, Figure 2.5).

Inputs are sliding speed [m/s], pressure [Pa] and disc temperature [degC], each held between the ends that it
was trained on and standardised; no memory. `identify friction` trains it.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from brakelab.plant.friction.law import Law, RigBrake
from brakelab.plant.jit import Record, kernel

INPUTS: Final = 3
HIDDEN: Final = (8, 6)
FIRST: Final = INPUTS * HIDDEN[0] + HIDDEN[0]  # weights of a layer, the biases last
SECOND: Final = HIDDEN[0] * HIDDEN[1] + HIDDEN[1]
WEIGHTS: Final = FIRST + SECOND + HIDDEN[1] + 1

LOW, HIGH, MIDDLE, SCALE = 1, 4, 7, 11  # first index of each in a row; output last in the two latter
LAYER_1: Final = 15
LAYER_2: Final = LAYER_1 + FIRST
LAYER_3: Final = LAYER_2 + SECOND

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


class Network(Law):
    law: Literal["network"]
    low: Three  # m/s, Pa, degC
    high: Three
    middle: Four  # of the inputs, then of friction
    scale: Four
    weights: Annotated[tuple[float, ...], Field(min_length=WEIGHTS, max_length=WEIGHTS)]
    """Layer by layer: a row per input, of a weight per sigmoid; then the biases."""

    @model_validator(mode="after")
    def _finite_range(self) -> Self:
        if min(self.scale) <= 0.0 or any(a > b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError("give scales above zero, and low below high")
        return self

    def row(self, brake: RigBrake) -> Sequence[float]:
        return (1.0, *self.low, *self.high, *self.middle, *self.scale, *self.weights)


@kernel
def sigmoid(x: float) -> float:
    """Return 1 / (1 + exp(-x)), x within 50."""
    return 1.0 / (1.0 + math.exp(-min(max(x, -50.0), 50.0)))


@kernel
def scaled(row: Record, place: int, value: float) -> float:
    """Return an input as the network sees it."""
    return (min(max(value, row[LOW + place]), row[HIGH + place]) - row[MIDDLE + place]) / row[SCALE + place]


@kernel
def step(
    row: Record,
    memory: float,
    pressure: float,
    speed: float,
    slowing: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """Return the memory unchanged, and friction."""
    v, p, heat = scaled(row, 0, speed), scaled(row, 1, pressure), scaled(row, 2, temperature)
    first, second = HIDDEN
    out = row[LAYER_3 + second]
    for k in range(second):
        total = row[LAYER_2 + first * second + k]
        for j in range(first):  # computed anew for each k: no room is needed for the layer
            below = row[LAYER_1 + j] * v + row[LAYER_1 + first + j] * p + row[LAYER_1 + 2 * first + j] * heat
            total += row[LAYER_2 + second * j + k] * sigmoid(below + row[LAYER_1 + INPUTS * first + j])
        out += row[LAYER_3 + k] * sigmoid(total)
    return memory, row[MIDDLE + INPUTS] + row[SCALE + INPUTS] * out
