"""The estimators of section 2.4 that have no memory: static LuGre, response surface, network."""

from collections.abc import Sequence

import numpy as np

from brakelab.identify.friction.candidate import Candidate, Free, Trained
from brakelab.identify.friction.network import STARTS, train_best
from brakelab.identify.friction.stops import Stops, block_inputs
from brakelab.plant.friction.law import Law
from brakelab.plant.friction.network import INPUTS, Network
from brakelab.plant.friction.quadratic import Quadratic
from brakelab.plant.friction.static_lugre import StaticLugre


def static_lugre(stops: Stops, mass: float) -> Candidate:
    """Return the steady friction of the LuGre model."""
    fast = float(stops.speed.max())
    free = (
        Free("mu_C", "–", 0.05, 1.0, friction=True),
        Free("mu_S − mu_C", "–", -0.3, 0.6),
        Free("v_S", "m/s", 0.05 * fast, 2.0 * fast, log=True),
        Free("sigma_2", "s/m", -0.5 / fast, 0.5 / fast),
    )

    def law(values: Sequence[float]) -> Law:
        coulomb, rise, stribeck, viscous = values
        return StaticLugre(
            law="static_lugre",
            rig_mass=mass,
            coulomb=coulomb,
            static=max(coulomb + rise, 0.0),
            stribeck=stribeck,
            viscous=viscous,
            highest_speed=fast,
        )

    return Candidate("static_lugre", free, law, False, "knows speed alone: no fade", True)


def quadratic(stops: Stops, mass: float) -> Candidate:
    """Return the second-order response surface, over the middle 98 % of speed and pressure."""
    low, high = np.percentile(block_inputs(stops)[:, :2], [1.0, 99.0], axis=0)
    terms = ("v", "p", "v²", "v p", "p²")
    free = (Free("mu", "–", 0.05, 1.0, friction=True), *(Free(term, "–", -0.3, 0.3) for term in terms))

    def law(values: Sequence[float]) -> Law:
        c_0, c_1, c_2, c_3, c_4, c_5 = values
        return Quadratic(
            law="quadratic",
            rig_mass=mass,
            speed=(float(low[0]), float(high[0])),
            pressure=(1e-5 * float(low[1]), 1e-5 * float(high[1])),
            factors=(c_0, c_1, c_2, c_3, c_4, c_5),
        )

    return Candidate("quadratic", free, law, False, "knows speed and pressure alone: no fade", True)


def trained_network(mass: float) -> Candidate:
    """Return the network, which is trained instead of searched."""

    def train(stops: Stops, seed: int) -> Trained:
        inputs = block_inputs(stops)
        found, agreed = train_best(inputs, stops.mu, stops.block_stop, seed)
        ends = inputs.min(axis=0), inputs.max(axis=0)
        return Trained(
            np.concatenate([*ends, found.middle, found.scale, found.weights]).tolist(), agreed, STARTS
        )

    def law(values: Sequence[float]) -> Law:
        names = ("low", "high", "middle", "scale", "weights")
        parts = np.split(np.asarray(values), (INPUTS, 2 * INPUTS, 3 * INPUTS + 1, 4 * INPUTS + 2))
        given = {name: part.tolist() for name, part in zip(names, parts, strict=True)}
        return Network.model_validate({"law": "network", "rig_mass": mass, **given})

    limit = "constant beyond the speeds, pressures and temperatures seen; between them whatever it learned"
    return Candidate("network", (), law, False, limit, True, train)
