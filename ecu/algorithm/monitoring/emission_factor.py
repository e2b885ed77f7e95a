"""Emission factor of a brake application, EF = log10 of its particles (8.1), by one of three models.

    network   EF = m + s (c + sum_k c_k tanh(b_k + sum_i w_ki z_i)), z_i scaled from v_in, v_end,
              log10 torque, temperature, log10 duration (8.2, 8.4); logarithms: beyond the thesis
    table     bilinear over v_in and the mean pressure, its edges held (the map of [38], Figure 8.5)
    law       EF = c_0 + c_1 log10(T v d) + c_2 log10(v) + c_3 log10(T v) + c_4 t + sum_k c_k max(t - t_k, 0)
              with the mean speed v, torque T, duration d and temperature t; all but c_0 are not negative, so
              that more work, more power, more speed and more heat never emit less: effects (i), (ii), (iv)

Source: sections 8.1, 8.4 to 8.6. The law is this project's.
"""

import math
from typing import Final

import numpy as np

from ecu.contract.dust import HIDDEN, INPUTS, KNOTS, NETWORK, NODES, TABLE
from ecu.jit import Record, kernel

V_IN, V_END, TORQUE, TEMPERATURE, DURATION, PRESSURE = range(6)
N_FEATURES: Final = 6
SCALE: Final = 0.01  # 1/K
KNOT_PLACES: Final = np.array(KNOTS)
N_KNOTS: Final = len(KNOTS)


@kernel
def law_term(features: Record, k: int) -> float:
    """Return the regressor of the law's coefficient k + 1; `features`, shape (6,), all above zero."""
    speed: float = 0.5 * (features[V_IN] + features[V_END])
    power: float = math.log10(features[TORQUE] * speed)
    if k == 0:
        return power + math.log10(features[DURATION])
    if k == 1:
        return math.log10(speed)
    if k == 2:
        return power
    heat: float = SCALE * features[TEMPERATURE]
    if k == 3:
        return heat
    return max(heat - SCALE * KNOT_PLACES[k - 4], 0.0)


@kernel
def network_input(features: Record, i: int) -> float:
    """Return unscaled input i of the network; `features`, shape (6,), all above zero."""
    value: float = features[i]
    if i in (TORQUE, DURATION):
        value = math.log10(value)
    return value


@kernel
def _network(numbers: Record, features: Record) -> float:
    place, total = 2 * INPUTS + 2, numbers[2 * INPUTS + 2 + HIDDEN * (INPUTS + 1) + HIDDEN]
    for k in range(HIDDEN):
        drive = numbers[place + INPUTS]
        for i in range(INPUTS):
            z = (network_input(features, i) - numbers[i]) / numbers[INPUTS + i]
            drive += numbers[place + i] * z
        total += numbers[2 * INPUTS + 2 + HIDDEN * (INPUTS + 1) + k] * math.tanh(drive)
        place += INPUTS + 1
    return numbers[2 * INPUTS] + numbers[2 * INPUTS + 1] * total


@kernel
def node_below(numbers: Record, first: int, value: float) -> tuple[int, float]:
    """Return the node below `value` in `numbers[first:]`, and the fraction to the next, 0 to 1."""
    k = 0
    while k < NODES - 2 and value >= numbers[first + k + 1]:
        k += 1
    share = (value - numbers[first + k]) / (numbers[first + k + 1] - numbers[first + k])
    return k, min(max(share, 0.0), 1.0)


@kernel
def _table(numbers: Record, features: Record) -> float:
    i, a = node_below(numbers, 0, features[V_IN])
    j, b = node_below(numbers, NODES, features[PRESSURE])
    at = 2 * NODES + i * NODES + j
    near = (1.0 - b) * numbers[at] + b * numbers[at + 1]
    far = (1.0 - b) * numbers[at + NODES] + b * numbers[at + NODES + 1]
    return (1.0 - a) * near + a * far


@kernel
def emission_factor(model: int, numbers: Record, features: Record) -> float:
    """Return EF by `model` of `ecu.dust.MODELS` and its numbers; `features`, shape (6,), all above zero."""
    if model == NETWORK:
        return _network(numbers, features)
    if model == TABLE:
        return _table(numbers, features)
    total: float = numbers[0]
    for k in range(4 + N_KNOTS):
        total += numbers[k + 1] * law_term(features, k)
    return total


@kernel
def emission_factors(model: int, numbers: Record, features: Record, out: Record) -> None:
    """Overwrite `out`, shape (n,), by EF of `features`, shape (n, 6)."""
    for k in range(len(features)):
        out[k] = emission_factor(model, numbers, features[k])


@kernel
def inside(low: Record, high: Record, features: Record) -> bool:
    """Return whether `features` lie within a model's training range."""
    known = True
    for i in range(N_FEATURES):
        known = known and low[i] <= features[i] <= high[i]
    return known
