"""Gain and phase margin of the loop through pressure law, hydraulics, car and friction observer.

The loop: friction in use -> pressure demand (5.8) -> hydraulics -> brake torque, wheel speed, deceleration ->
observer -> friction estimate -> friction in use. It is cut at the friction in use, where a sine of
`AMPLITUDE` disturbs the simulated brake application, at one axle after the other; the response is the
estimate. Each drive is run with the sine and with its negative, so that noise, drift and temperature cancel:

    L_ij = ln mu_i(+) - ln mu_i(-), in phase with the sine, over 2 amplitude_j        i, j: front, rear

Closed, the loop feeds L back with a positive sign; it is stable where no eigenvalue of L encircles +1. Gain
margin is 1 / the largest modulus of an eigenvalue (admissible factor on the loop gain, at any phase), phase
margin the least phase where a modulus is 1, distance the least |1 - eigenvalue|. The limit of `FRICTION_RATE`
on the friction in use is neglected: it makes the loop slower still.
"""

from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.simulation.accuracy import AXLES, columns
from brakelab.simulation.closed_loop import FrictionOverride, new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.studies.study import Asked, Measured, Study, picture
from ecu.settings.config import Config

CARS: Final = 5
FREQUENCIES: Final = (0.2, 0.35, 0.6, 1.0, 1.7, 2.8, 4.5, 7.0)  # Hz; the observer's windows end at 10
AMPLITUDE: Final = 0.05
DECEL: Final = 2.5  # m/s^2
SETTLED_S, LEAST_SPEED = 2.0, 6.0  # of the counted part: since the begin of the application, m/s
COLOURS: Final = (GREY, ORANGE, BLUE, GREEN, PINK)

Complex = NDArray[np.complex128]


class Margins(NamedTuple):
    """One car's loop."""

    loop: Complex
    """L by frequency, shape (frequencies, 2, 2)."""
    eigenvalues: Complex
    """Shape (frequencies, 2)."""

    @property
    def largest(self) -> float:
        """The largest modulus of an eigenvalue."""
        return float(np.abs(self.eigenvalues).max())

    @property
    def at_hz(self) -> float:
        """Frequency of that eigenvalue [Hz]."""
        return FREQUENCIES[int(np.abs(self.eigenvalues).max(axis=1).argmax())]

    @property
    def distance(self) -> float:
        """The least |1 - eigenvalue|."""
        return float(np.abs(1.0 - self.eigenvalues).min())

    @property
    def phase_margin(self) -> float:
        """Least phase [degrees] where a modulus is 1 or more; infinite if none is."""
        there = np.abs(self.eigenvalues) >= 1.0
        return float(np.abs(np.angle(self.eigenvalues[there], deg=True)).min()) if there.any() else np.inf


def braking() -> Scenario:
    """Return one long brake application from 144 km/h."""
    phases = [
        Phase(kind="cruise", speed=40.0, seconds=1.0),
        Phase(kind="brake", decel=DECEL, until_speed=0.5 * LEAST_SPEED),
    ]
    return shipped("stop-1").model_copy(update={"initial_speed": 40.0, "phase": phases})


def in_phase(t: NDArray[np.float64], y: NDArray[np.float64], frequency: float) -> complex:
    """Return amplitude and phase of `y` relative to sin(2 pi frequency t), over whole periods.

    They are counted back from the last row.
    """
    period = 1.0 / frequency
    rows = t > t[-1] - np.floor((t[-1] - t[0]) / period + 1e-9) * period + 1e-9
    t, y = t[rows], y[rows]
    basis = np.stack(
        [np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t), np.ones_like(t), t]
    )
    sine, cosine = np.linalg.lstsq(basis.T, y, rcond=None)[0][:2]
    return complex(sine, cosine)


def _estimates(
    config: Config, seed: int, override: FrictionOverride
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time [s] and ln of the friction estimated at both axles, shape (2, n), of an application."""
    drive = run(new_loop(braking(), config, seed), override=override)
    rows = (drive.t > 1.0 + SETTLED_S) & (drive.truth["vehicle_speed"] > LEAST_SPEED)
    return drive.t[rows], np.stack(
        [np.log(columns(drive.outputs, "mu_b", a, rows)).mean(axis=0) for a in AXLES]
    )


def margins_of(config: Config, seed: int) -> Margins:
    """Measure the loop of one car."""
    loop = np.empty((len(FREQUENCIES), 2, 2), np.complex128)
    for place, frequency in enumerate(FREQUENCIES):
        for axle in range(2):
            both = []
            for sign in (1.0, -1.0):
                size = [sign * AMPLITUDE if axle == other else 0.0 for other in range(2)]
                both.append(_estimates(config, seed, FrictionOverride(0.0, size[0], size[1], frequency)))
            n = min(len(both[0][0]), len(both[1][0]))
            change = 0.5 * (both[0][1][:, :n] - both[1][1][:, :n]) / AMPLITUDE
            for back in range(2):
                loop[place, back, axle] = in_phase(both[0][0][:n], change[back], frequency)
    return Margins(loop, np.linalg.eigvals(loop).astype(np.complex128))


def _decibel(value: float) -> str:
    return f"{20.0 * np.log10(value):.0f}"


def margin_tables(cars: list[Margins]) -> list[Table]:
    """Return margins by car and the loop's gains by frequency."""

    def line(name: str, largest: float, hz: str, phase: float, distance: float) -> tuple[str, ...]:
        angle = "none: never 1" if np.isinf(phase) else f"{phase:.0f}"
        return name, f"{largest:.3f}", hz, _decibel(1.0 / largest), angle, f"{distance:.2f}"

    rows = [
        line(f"car {number}", car.largest, f"{car.at_hz:g}", car.phase_margin, car.distance)
        for number, car in enumerate(cars)
    ]
    rows.append(
        line(
            "worst",
            max(car.largest for car in cars),
            "",
            min(car.phase_margin for car in cars),
            min(car.distance for car in cars),
        )
    )
    gains = []
    for place, frequency in enumerate(FREQUENCIES):
        parts = [np.array([abs(car.loop[place, i, j]) for car in cars]) for i in range(2) for j in range(2)]
        gains.append((f"{frequency:g}", *(f"{np.median(part):.3f} ({part.max():.3f})" for part in parts)))
    return [
        Table(
            "Margins",
            (
                "car",
                "largest loop gain",
                "at [Hz]",
                "gain margin [dB]",
                "phase margin [°]",
                "distance from +1",
            ),
            rows,
            f"Sine of {100 * AMPLITUDE:.0f} % in the friction in use while braking at {DECEL} m/s².",
        ),
        Table(
            "Loop gain: what a change of the friction in use comes back as in the estimate",
            ("frequency [Hz]", "front by front", "rear by front", "front by rear", "rear by rear"),
            gains,
            f"Median over {len(cars)} cars (largest).",
        ),
    ]


def margin_panels(cars: list[Margins]) -> list[Panel]:
    """Return the largest gain over frequency and the eigenvalues in the complex plane."""
    hz = np.array(FREQUENCIES)
    gain = [
        Line(hz, np.abs(c.eigenvalues).max(axis=1), colour) for c, colour in zip(cars, COLOURS, strict=False)
    ]
    away = [
        Line(hz, np.abs(1.0 - c.eigenvalues).min(axis=1), colour)
        for c, colour in zip(cars, COLOURS, strict=False)
    ]
    one = Line(hz[[0, -1]], np.ones(2), "#333", True)
    ends = (FREQUENCIES[0], FREQUENCIES[-1])
    return [
        Panel("largest loop gain; dashed: 1", "f [Hz]", ends, (0.0, 1.2), [one, *gain], True),
        Panel("distance from +1", "f [Hz]", ends, (0.0, 1.2), [one, *away], True),
    ]


LEGEND: Final = [(f"car {number}", colour) for number, colour in enumerate(COLOURS)]


TEXT: Final = (
    "How far the loop through pressure law, hydraulics, car and observer is from instability, measured "
    "with the loop cut at the friction in use (tools/brakelab/studies/control/margins.py). The loop gain is "
    "far below 1 at every frequency: an estimate of friction is torque over pressure, and more pressure "
    "gives more torque, so to first order the estimate does not see what the law does. What comes back is "
    "lag between the signals and what friction really owes to pressure.\n\n![Loop gain and distance from "
    "+1](images/control-margins.svg)"
)


def _run(asked: Asked) -> Measured:
    config = configured()
    cars = run_each("margins", partial(margins_of, config), range(CARS))
    drawn = picture("control-margins.svg", margin_panels(cars), LEGEND)
    return Measured(margin_tables(cars), draw=drawn)


STUDY: Final = Study("Margins of the control loop", TEXT, _run, "control-margins")
