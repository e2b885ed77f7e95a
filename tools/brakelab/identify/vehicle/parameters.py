"""What was identified, as keys of CONFIG: value, standard deviation, samples, origin; or the drive it needs.

Forces alone show products, so a key carries what START's other keys leave: `mu_nominal` the torque per bar
(with START's pistons and radius), `slip_stiffness` that of the axle at its load, `vertical_stiffness` the
deflection under load transfer (with START's height of the centre of gravity), `unloaded_radius` the rolling
radius at rest, `drag_coefficient` the drag area over START's frontal area. A key whose standard deviation
the drive does not halve is not identified; nor is one that is `FARTHEST_FROM_START` of START's standard
deviations off: what the fit could not explain is in it then.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.vehicle.model import Place, brakes_of, stiffness_of
from brakelab.identify.vehicle.solve import Identified
from ecu.algorithm.vehicle import rolling_radius
from ecu.contract.params import BAR, GRAVITY
from ecu.settings.config import AIR_DENSITY, Config

HALVED: Final = 0.5  # of the prior's standard deviation: a key is identified
ROUGH: Final = 0.05  # relative standard deviation from which a value is called rough
START_OFF: Final = 0.25  # relative, of START's lengths
TYRE: Final = 0.02  # likewise, of a radius by the tyre's size: tread of 8 mm, pressure, make
FARTHEST_FROM_START: Final = 3.0  # of START's standard deviations


PLACES: Final = {
    "vehicle.mass": Place.MASS,
    "vehicle.drag_coefficient": Place.DRAG,
    "vehicle.rolling_resistance": Place.ROLLING,
    "vehicle.pitch_gradient": Place.PITCH,
    "sensors.vehicle_speed_delay": Place.DELAY,
    "front.push_out_pressure": Place.PUSH_OUT_F,
    "rear.push_out_pressure": Place.PUSH_OUT_R,
}
"""Keys that are one parameter of the fit."""


class Parameter(NamedTuple):
    """One key."""

    key: str
    unit: str
    start: float
    value: float
    sigma: float
    windows: int
    source: str
    """Where the value comes from."""
    remedy: str
    """What would identify it, where the drive does not; else empty."""

    @property
    def doubt(self) -> str:
        """Return the word to put behind a value whose deviation is large, else nothing."""
        return ", rough" if self.sigma > ROUGH * abs(self.value) else ""


class _Kind(NamedTuple):
    key: str
    unit: str
    of: Callable[[Vector], float]
    kinds: tuple[int, ...]
    """Of residuals that show it."""
    source: str
    remedy: str


def free_radius(rolling: float, load: float, stiffness: float) -> float:
    """Return the radius [m] of an unloaded wheel that rolls with `rolling` [m] under `load` [N]."""
    radius = rolling
    for _ in range(30):
        radius += rolling - rolling_radius(load, radius, stiffness)
    return radius


def axle_loads(mass: float, config: Config) -> Vector:
    """Return the static load of front and rear axle [N], shape (2,)."""
    vehicle = config.vehicle
    share = np.array([vehicle.wheelbase - vehicle.front_axle, vehicle.front_axle]) / vehicle.wheelbase
    return np.asarray(mass * GRAVITY * share)


def _vertical(theta: Vector, config: Config) -> Vector:
    """Return the vertical stiffness of front and rear tyres [N/m], shape (2,): START's, scaled."""
    vehicle = config.vehicle
    own = np.array([config.front.vertical_stiffness, config.rear.vertical_stiffness])
    radius = np.exp(0.5 * (theta[Place.RADIUS_F] + theta[Place.RADIUS_R]))
    sink = np.exp(theta[Place.DEFLECTION])
    mean = np.exp(theta[Place.MASS]) * vehicle.cog_height / (6.0 * vehicle.wheelbase * sink * radius)
    return np.asarray(own * mean / own.mean())


def parameters_of(found: Identified, config: Config) -> list[Parameter]:
    """Return every key with what the drives say of it."""
    kinds = [*_car(found, config), *_axles(found, config)]
    rows = [_parameter(found, config, kind, found.fit.theta) for kind in kinds]
    left = [PLACES[one.key] for one in rows if one.remedy and one.key in PLACES]
    beside = _given(found, [place for place in left if found.prior.sigma[place] > 0.0])
    rows = [
        one if one.remedy else _parameter(found, config, kind, beside)
        for one, kind in zip(rows, kinds, strict=True)
    ]
    if found.pairs:
        track, sigma = found.pairs.track
        if not found.signals.speed:  # it is for START's tyres
            sigma = float(np.hypot(sigma, TYRE * track))
        rows.append(_of_track(config, track, sigma, found.pairs.windows))
    else:
        rows.append(_of_track(config, config.vehicle.track, config.vehicle.track, 0))
    return rows


def values_of(found: Identified, config: Config, theta: Vector) -> dict[str, float]:
    """Return the keys that parameters `theta` of the model have, beside START's other keys."""
    return {kind.key: kind.of(theta) for kind in (*_car(found, config), *_axles(found, config))}


def _given(found: Identified, left: list[Place]) -> Vector:
    """Return the parameters that go with START's value of those that are left there."""
    theta, covariance = found.fit.theta, found.fit.covariance
    if not left:
        return theta
    away = found.prior.mean[left] - theta[left]
    moved = theta + covariance[:, left] @ np.linalg.solve(covariance[np.ix_(left, left)], away)
    moved[left] = found.prior.mean[left]
    return np.asarray(moved)


def _of_track(config: Config, track: float, sigma: float, count: int) -> Parameter:
    start, remedy = config.vehicle.track, "a slalom at 30 to 50 km/h, or a tape measure"
    known = sigma < 0.5 * START_OFF * start
    if known and abs(track - start) > FARTHEST_FROM_START * START_OFF * start:
        known, remedy = False, _too_far(track, remedy)
    return Parameter(
        "vehicle.track", "m", start, track if known else start, sigma, count,
        "left against right wheels in curves", "" if known else remedy,
    )  # fmt: skip


def _car(found: Identified, config: Config) -> list[_Kind]:
    vehicle, signals = config.vehicle, found.signals
    area = 0.5 * AIR_DENSITY * vehicle.frontal_area
    coast = "coast-downs from 120 km/h, with the drive's torque reported or disengaged and reported as 0"
    kinds = [
        _Kind("vehicle.mass", "kg", lambda x: float(np.exp(x[Place.MASS])), (0,),
              "motor torque against acceleration",
              "accelerating and braking at 1 to 3 m/s^2 by motors whose torque is reported to 10 %; "
              "or scales"),
        _Kind("vehicle.drag_coefficient", "-", lambda x: float(np.exp(x[Place.DRAG])) / area, (0,),
              "specific force against the square of the speed", coast),
        _Kind("vehicle.rolling_resistance", "-", lambda x: float(x[Place.ROLLING]), (0,),
              "specific force of rolling, less the accelerometer's zero",
              "coast-downs on a drive that ends where it began (--closed), or standstills at many places"),
        _Kind("vehicle.pitch_gradient", "rad/(m/s^2)", lambda x: max(float(x[Place.PITCH]), 0.0), (),
              "accelerometer against the change of speed, without grade",
              "brake applications of 3 m/s^2 and more with a speed reference (optical, GNSS)"),
    ]  # fmt: skip
    if signals.speed:
        kinds.append(
            _Kind("sensors.vehicle_speed_delay", "s", lambda x: max(float(x[Place.DELAY]), 0.0),
                  (2, 3, 4, 5), "reference against wheels while the speed changes",
                  "accelerating and braking with a speed reference")
        )  # fmt: skip
    return kinds


def _axles(found: Identified, config: Config) -> list[_Kind]:
    kinds: list[_Kind] = []
    for place, axle in enumerate(("front", "rear")):
        own: Any = getattr(config, axle)
        per_mu = 4.0 * own.pistons * np.pi / 4.0 * own.piston_diameter**2 * own.effective_radius * BAR

        def radius(x: Vector, place: int = place) -> float:
            load = axle_loads(float(np.exp(x[Place.MASS])), config)[place] / 2.0
            stiffness = float(_vertical(x, config)[place]) if found.pairs else _own(config, place)
            return free_radius(float(np.exp(x[Place.RADIUS_F + place])), float(load), stiffness)

        def stiffness(x: Vector, place: int = place) -> float:
            return float(stiffness_of(x)[place] / axle_loads(float(np.exp(x[Place.MASS])), config)[place])

        def friction(x: Vector, place: int = place, per_mu: float = per_mu) -> float:
            return float(brakes_of(x)[place]) / per_mu

        def push_out(x: Vector, place: int = place) -> float:
            return max(float(x[Place.PUSH_OUT_F + place]), 0.0)

        def vertical(x: Vector, place: int = place) -> float:
            return float(_vertical(x, config)[place])

        speed = "speed reference over wheel speeds, less slip"
        ratio = "rear over front wheel speeds, less slip; scale by START's front radius"
        kinds += [
            _Kind(f"{axle}.unloaded_radius", "m", radius, (2 + 2 * place, 3 + 2 * place),
                  speed if found.signals.speed else ratio,
                  "a speed reference (GNSS, optical) on straight roads at two constant speeds"),
            _Kind(f"{axle}.vertical_stiffness", "N/m", vertical, (),
                  "left against right wheels in curves, with START's height of the centre of gravity",
                  "a slalom at 50 to 90 km/h: curves of 2 m/s^2 to both sides"),
            _Kind(f"{axle}.slip_stiffness", "-", stiffness, (2 + 2 * place, 3 + 2 * place),
                  "slip against force at START's axle loads",
                  "motor-only brake applications of 2 to 3 m/s^2 with a speed reference"),
            _Kind(f"{axle}.mu_nominal", "-", friction, (1, 3 + 2 * place),
                  "torque per bar with START's pistons and radius, mean of all brake applications",
                  "brake applications of 1.5 to 5 m/s^2 with calliper pressures"),
            _Kind(f"{axle}.push_out_pressure", "bar", push_out, (1,), "brake applications at low pressure",
                  "many brake applications of less than 1.5 m/s^2"),
        ]  # fmt: skip
    return kinds


def _own(config: Config, place: int) -> float:
    return (config.front, config.rear)[place].vertical_stiffness


def _slope(of: Callable[[Vector], float], theta: Vector, sigma: Vector) -> Vector:
    slope = np.zeros_like(theta)
    for place in np.flatnonzero(sigma > 0.0):
        step = np.zeros_like(theta)
        step[place] = 1e-3 * sigma[place]
        slope[place] = (of(theta + step) - of(theta - step)) / (2.0 * step[place])
    return slope


def _parameter(found: Identified, config: Config, kind: _Kind, beside: Vector) -> Parameter:
    """Return a key; `beside`: parameters that its value goes with."""
    prior = found.prior
    slope = _slope(kind.of, found.fit.theta, prior.sigma)
    sigma = float(np.sqrt(max(float(slope @ found.fit.covariance @ slope), 0.0)))
    before = float(np.sqrt(slope**2 @ prior.sigma**2))
    section, _, name = kind.key.partition(".")
    start = float(getattr(getattr(config, section), name))
    counts = np.bincount(found.residuals.kind, minlength=6)
    windows = int(counts[list(kind.kinds)].sum()) if kind.kinds else 0
    if name == "pitch_gradient":
        windows = found.dive[2] if found.dive else 0
    if name == "vertical_stiffness":
        windows = found.pairs.windows if found.pairs else 0
    identified, remedy = windows > 0 and 0.0 < sigma < HALVED * before, kind.remedy
    value = kind.of(beside) if identified else start
    start_sigma = float(np.sqrt(_slope(kind.of, prior.mean, prior.sigma) ** 2 @ prior.sigma**2))
    if identified and abs(value - kind.of(prior.mean)) > FARTHEST_FROM_START * start_sigma:
        identified, value, remedy = False, start, _too_far(value, remedy)
    return Parameter(
        kind.key, kind.unit, start, value, sigma, windows, kind.source, "" if identified else remedy
    )


def _too_far(value: float, remedy: str) -> str:
    return f"a better START, which {value:.4g} is too far from, or {remedy}"
