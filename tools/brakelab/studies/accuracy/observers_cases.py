"""Cases for the observers: drives with goals, and errors of car, sensors or road.

A goal is the nRMSE [%] of front and rear friction that the joint observer should not exceed: `cold` with
nominal configuration and nothing learned, `adapted` after `config/scenarios/ordinary.toml`. Those of
`NOMINAL` are for cars of the nominal draw. A disturbance of either sign takes that of its car: negative for
odd seeds, positive for even ones.
"""

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any, Final, NamedTuple

from brakelab.plant.sensor_errors import ABSENT, SensorErrors
from brakelab.simulation.configured import shipped, with_keys
from brakelab.simulation.scenario import Phase, RoadByPlace, Scenario, SteeringFile
from ecu.settings.config import Config

EVERY_SENSOR: Final = (
    *("accel_x", "accel_y", "yaw_rate", "vehicle_speed"),
    *("wheel_speed", "calliper_pressure", "motor_torque", "steering_angle"),
)
CROSSTALK: Final = 0.01  # of a measuring wheel (Table D.2)
NONLINEAR: Final = 0.005 * 35e3  # N, 0.5 % of its range; of each wheel
DRY_FALL: Final = 0.4  # c_3 / c_1 of Burckhardt's tyre on dry asphalt, 0.52 / 1.28
GAP, BETWEEN_GAPS = 0.180, 2.0  # s, means
LASTING: Final = 0.5  # s, of a motor torque's error that is not white
LOST_IN_GAPS: Final = GAP / (GAP + BETWEEN_GAPS)
SLOW_PERIODS: Final = dict.fromkeys(("accel_x", "accel_y", "yaw_rate", "wheel_speed"), 1.0 / 66.0)
"""s; the other sensors have 33 Hz."""


class Setup(NamedTuple):
    """One car on one drive."""

    scenario: Scenario
    config: Config
    car: tuple[tuple[str, tuple[float, ...]], ...] = ()
    """Parameters of the drawn car and factors upon them per wheel."""
    form: tuple[tuple[str, float], ...] = ()
    """Parameters of the drawn car that are set: another law than that of its file."""
    any_rate: bool = False
    """The ECU expects inputs at any rate."""


Change = Callable[[Setup, float], Setup]
"""Makes a setup of another; the number is the sign of the car."""
Goal = tuple[float, float]
"""Front and rear [%]."""


def _as_is(setup: Setup, sign: float) -> Setup:
    return setup


def _unguarded(setup: Setup, sign: float) -> Setup:
    """Let wheels lock: the behaviour of the observers is measured (Figure 5.5)."""
    return _configured(setup, {"control.slip_guard": False})


def _configured(setup: Setup, keys: Mapping[str, Any]) -> Setup:
    return setup._replace(config=with_keys(setup.config, keys))


class Case(NamedTuple):
    """One line of a table."""

    scenario: Scenario
    cold: Goal | None = None
    """None: better than the nominal constant."""
    adapted: Goal | None = None
    thesis: str = "–"
    """nRMSE of Observer 2 there, front/rear [%]."""
    change: Change = _as_is
    lasting: bool = False
    """The change is there in ordinary driving too."""
    beside: str = ""
    """The case whose errors it may exceed by a quarter."""


def _stop(**brake: Any) -> Scenario:
    """Return one stop from 100 km/h, the first of `sensitivity` with another brake application."""
    base = shipped("sensitivity")
    return base.model_copy(update={"phase": [base.phase[0], Phase(kind="brake", until_speed=0.0, **brake)]})


def _accuracy() -> dict[str, Case]:
    cases = {
        f"stop #{test}": Case(shipped(f"stop-{test}"), cold, adapted, thesis)
        for test, cold, adapted, thesis in (
            (1, (2.5, 4.0), (1.3, 1.8), "4.74/7.23"),
            (2, (2.5, 4.0), (1.3, 1.8), "3.34/6.96"),
            (3, (2.5, 4.0), (1.3, 1.8), "4.55/8.51"),
            (4, (2.5, 4.0), (1.3, 1.8), "3.13/7.87"),
        )
    }
    for decel in (0.7, 1.0, 1.3, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0):
        cold = (4.0, 4.0) if decel >= 1.0 else None
        reached = 3.0 if decel <= 2.0 else 2.0
        cases[f"{decel:g} m/s²"] = Case(_stop(decel=decel), cold, (reached, reached))
    slippery = _stop(decel=5.6).model_copy(update={"road_friction": [(0.0, 0.7)]})
    cases["5.6 m/s² where 0.7 holds"] = Case(slippery, (2.5, 3.3), (2.0, 2.5))
    for percent, cold, reached, thesis in (
        (20, (5.4, 8.2), 1.2, "5.42/8.16"),
        (40, (8.3, 11.3), 1.2, "8.27/11.33"),
        (60, (11.9, 15.9), 2.0, "11.89/15.87"),
        (80, (13.4, 20.5), 4.0, "13.43/20.46"),
    ):
        name = f"blending {percent / 100:g}"
        cases[name] = Case(shipped(f"blending-{percent}"), cold, (reached, reached), thesis)
    for pedal, thesis in ((20.0, "8.84/22.44"), (28.0, "7.35/15.88"), (48.0, "3.75/10.11")):
        reached = 3.0 if pedal < 40.0 else 2.0
        cases[f"pedal {pedal:g} %"] = Case(_stop(pedal=pedal), (4.0, 7.0), (reached, reached), thesis)
    cases["fade"] = Case(shipped("fade"), (3.0, 5.0), (1.5, 1.5), "3.8–9.6/4.7–22")
    return cases


def _changed(**factors: float) -> Change:
    """Return the change of configured values by 1 ± a share, by section and key with two underlines."""

    def change(setup: Setup, sign: float) -> Setup:
        keys = {name.replace("__", "."): 1.0 + sign * share for name, share in factors.items()}
        return _configured(
            setup, {key: attrgetter(key)(setup.config) * factor for key, factor in keys.items()}
        )

    return change


def _sensing(sign_of: Callable[[float], dict[str, SensorErrors]]) -> Change:
    """Return the change of sensors; `sign_of` gives them for a sign."""
    return lambda setup, sign: _scenario(setup, sensor=sign_of(sign))


def _scenario(setup: Setup, **update: Any) -> Setup:
    return setup._replace(scenario=setup.scenario.model_copy(update=update))


def _late_speed(setup: Setup, sign: float) -> Setup:
    return _scenario(_configured(setup, {"sensors.vehicle_speed_delay": 0.15}), vehicle_speed="gnss")


def _slow_inputs(setup: Setup, sign: float) -> Setup:
    sensor = {}
    for name in EVERY_SENSOR:
        period = SLOW_PERIODS.get(name, 1.0 / 33.0)
        sensor[name] = SensorErrors(period=period, dropout=period / BETWEEN_GAPS, dropout_length=GAP / period)
    return _scenario(setup, sensor=sensor)._replace(any_rate=True)


def _radii(setup: Setup, sign: float) -> Setup:
    share = 0.005 * sign  # front against rear resembles slip
    return setup._replace(car=(("free_radius", (1.0 + share, 1.0 + share, 1.0 - share, 1.0 - share)),))


def _burckhardt(setup: Setup, sign: float) -> Setup:
    return setup._replace(form=(("burckhardt_fall", DRY_FALL),))


def _unequal(setup: Setup, sign: float) -> Setup:
    left, right = 1.0 + 0.1 * sign, 1.0 - 0.1 * sign
    return setup._replace(car=(("friction_scale", (left, right, left, right)),))


def _robustness() -> dict[str, Case]:
    stop = shipped("stop-1")
    lasting: dict[str, Change] = {
        "mass ±10 %": _changed(vehicle__mass=0.1),
        "rolling radius ±0.5 %, rear ∓": _radii,
        "tyre stiffness ±30 %": _changed(front__slip_stiffness=0.3, rear__slip_stiffness=0.3),
        "tyre of another form (Burckhardt)": _burckhardt,
        "pressure offset ±1 bar": _sensing(
            lambda sign: {"calliper_pressure": SensorErrors(bias=(sign, sign))}
        ),
        "accelerometer bias ±0.1 m/s²": _sensing(
            lambda sign: {"accel_x": SensorErrors(bias=(0.1 * sign, 0.1 * sign))}
        ),
        "pitch gradient ±30 %": _changed(vehicle__pitch_gradient=0.3),
        "centre of gravity height ±10 %": _changed(vehicle__cog_height=0.1),
        "brakes unequal by 20 %": _unequal,
        "motor torque ±3 %": _sensing(lambda sign: {"motor_torque": SensorErrors(scale=1.0 + 0.03 * sign)}),
        "no vehicle speed": lambda setup, sign: _scenario(setup, vehicle_speed="none"),
        "vehicle speed at 10 Hz, 100–200 ms late": _late_speed,
        "5 % of the samples lost": _sensing(
            lambda sign: {name: SensorErrors(dropout=0.05) for name in EVERY_SENSOR}
        ),
        "inputs at 33–66 Hz, gaps of 180 ms": _slow_inputs,
    }
    passing: dict[str, Change] = {
        "nothing": _as_is,
        "wheel sensor lost while braking": _sensing(
            lambda sign: {"wheel_speed_fl": SensorErrors(lost_from=8.0)}
        ),
        "grade ±8 %": lambda setup, sign: _scenario(setup, grade=[(0.0, 0.08 * sign)]),
        "friction 0.5 left, 1.0 right": lambda setup, sign: _scenario(
            setup, road=RoadByPlace(friction=[(0.0, 1.0, 1.0), (230.0, 1.0, 1.0), (230.1, 0.5, 1.0)])
        ),
    }
    twice = (2.6, 3.6)
    cases = {name: Case(stop, None, twice, change=change) for name, change in passing.items()}
    cases |= {name: Case(stop, None, twice, change=change, lasting=True) for name, change in lasting.items()}
    curve = shipped("curve")
    assert curve.steering is not None
    gentler = SteeringFile(angle=[(t, 0.8 * angle) for t, angle in curve.steering.angle])
    cases["braking in a curve, 4 m/s² across"] = Case(
        curve.model_copy(update={"steering": gentler}), None, twice
    )
    cases["split friction, left wheels lock"] = Case(shipped("split"), None, twice, change=_unguarded)
    return cases


def _after_cruise(seconds: float, grade: float, motor_torque: SensorErrors) -> Scenario:
    """Return a stop of 4 m/s² after a cruise at 100 km/h."""
    stop = _stop(decel=4.0)
    cruise = stop.phase[0].model_copy(update={"seconds": seconds})
    sensor = stop.sensor | {"motor_torque": motor_torque}
    changed = {"phase": [cruise, stop.phase[1]], "grade": [(0.0, grade)], "sensor": sensor}
    return stop.model_copy(update=changed)


def _sensors() -> dict[str, Case]:
    """Return cases with sensors as cars have them, each after the case that it is compared with."""
    quiet = SensorErrors(noise=0.0)
    lasting = SensorErrors(noise=0.0, drift=10.0 * (2.0 / LASTING) ** 0.5, drift_time=LASTING)
    cases = {}
    for road, grade in (("level road", 0.0), ("5 % climb", 0.05)):
        base = f"a minute on a {road}, no noise"
        cases[base] = Case(_after_cruise(60.0, grade, quiet))
        for noise in (3.0, 20.0):
            name = f"a minute on a {road}, {noise:g} N m"
            cases[name] = Case(_after_cruise(60.0, grade, SensorErrors(noise=noise)), beside=base)
        cases[f"a minute on a {road}, 10 N m that last {LASTING:g} s"] = Case(
            _after_cruise(60.0, grade, lasting), beside=base
        )
    cases["an hour, 10 N m"] = Case(
        _after_cruise(3600.0, 0.0, SensorErrors(noise=10.0)), beside="a minute on a level road, no noise"
    )
    floored = _sensing(lambda sign: {"calliper_pressure": SensorErrors(floor=0.0)})
    for decel in (1.0, 4.0):
        base = f"{decel:g} m/s², every signal"
        cases[base] = Case(_stop(decel=decel))
        name = f"{decel:g} m/s², no pressure below zero"
        cases[name] = Case(_stop(decel=decel), change=floored, lasting=True, beside=base)
    lacking: dict[str, Change] = {
        "no yaw rate, no steering angle": _sensing(
            lambda sign: dict.fromkeys(("yaw_rate", "steering_angle"), ABSENT)
        ),
        "accelerometer at 10 Hz": _sensing(lambda sign: {"accel_x": SensorErrors(period=0.1)}),
        "pressures at 20 Hz": _sensing(lambda sign: {"calliper_pressure": SensorErrors(period=0.05)}),
        "motor torque not reported": _sensing(lambda sign: {"motor_torque": ABSENT}),
    }
    for name, change in lacking.items():
        at_any_rate = _at_any_rate(change)
        cases[name] = Case(_stop(decel=4.0), change=at_any_rate, lasting=True, beside=base)
    return cases


def _at_any_rate(change: Change) -> Change:
    return lambda setup, sign: change(setup, sign)._replace(any_rate=True)


ACCURACY: Final = _accuracy()
ROBUSTNESS: Final = _robustness()
SENSORS: Final = _sensors()
NOMINAL: Final[dict[str, tuple[Goal, Goal]]] = {
    "stop #1": ((2.4, 3.6), (0.8, 0.9)),
    "stop #2": ((1.7, 3.5), (1.2, 1.2)),
    "stop #3": ((2.3, 4.3), (0.9, 1.0)),
    "stop #4": ((1.6, 3.9), (1.5, 1.5)),
}
"""Goals, cold and adapted, of cases that cars of the nominal draw should do better."""


def goals(name: str, draw: str) -> tuple[Goal | None, Goal | None]:
    """Return the goals of a case, unadapted and adapted, for cars drawn so."""
    case = CASES[name]
    if draw != "nominal":
        return case.cold, case.adapted
    if name in ROBUSTNESS:
        return case.cold, (1.6, 1.8)
    return NOMINAL.get(name, (case.cold, case.adapted))


WRONG_START: Final = "linings 25 % off"


def _wrong_start(setup: Setup, sign: float) -> Setup:
    """Configure nominal frictions a quarter above those of config/plant/suv.toml."""
    return _configured(setup, {"front.mu_nominal": 1.25 * 0.3825, "rear.mu_nominal": 1.25 * 0.495})


EVENTS: Final = {
    WRONG_START: Case(shipped("stop-1"), change=_wrong_start),
    "tyre stiffness × 0.67": Case(shipped("tyre-stiffness")),
    "low-grip patch": Case(shipped("low-grip"), change=_unguarded),
}
"""Drives whose times are reported."""
LONGEST_EFFECT: Final = {"tyre stiffness × 0.67": 0.10, "low-grip patch": 0.30}
"""How long their events may be felt [s]: as in the thesis, read off Figures 4.11 and 5.5."""
TRANSDUCERS: Final = {
    "stop #1, transducers as Table D.2": Case(
        shipped("stop-1"),
        change=_sensing(
            lambda sign: {
                "wheel_force_x": SensorErrors(scale=1.0 + CROSSTALK * sign, bias=(-NONLINEAR, NONLINEAR))
            }
        ),
    )
}
"""Drives of Observer 1."""
CASES: Final = ACCURACY | ROBUSTNESS | SENSORS | EVENTS | TRANSDUCERS
