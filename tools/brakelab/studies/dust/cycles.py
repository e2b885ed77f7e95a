"""`brake-ecu bench cycles`: dust and wear of the shipped cars on two cycles, and braking against them."""

from functools import partial
from typing import Final, NamedTuple

import numpy as np

from brakelab.results import euro7
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.simulation.configured import with_keys
from brakelab.studies.dust.cycle_cars import (
    SHIPPED,
    Shipped,
    drawn,
    emission_models,
    share_of_energy,
    with_models,
)
from brakelab.studies.dust.cycle_drives import CYCLES, REAL_DRIVING, WLTP_BRAKE, CycleDrive, drive_cycle
from brakelab.studies.dust.cycle_open import OpenDrive, drive_open, real_driving_profile, wltp_brake_profile
from brakelab.studies.study import Asked, Measured, Study
from ecu.settings.config import Config, new_params

CAR: Final = 1
"""Seed of the car that is driven in closed loop."""
FIRST_DRAW: Final = 10
"""Seeds 0 to 7 of the sport utility vehicle served to choose the constants of `lining_share.py`."""
DRAWS: Final = 4
LIMITS: Final = {"suv": euro7.CAR, "sedan": euro7.CAR, "lcv": euro7.VAN, "suv-blended": euro7.ELECTRIC_CAR}
"""mg/km of Euro 7 for each type: car, car, N1 of class III, battery electric car."""
GOAL: Final = 15.0  # % of dust
POLICIES: Final = ("off", "dust")


class Driven(NamedTuple):
    """A car over the cycles in closed loop."""

    car: Shipped
    drives: dict[tuple[str, str], CycleDrive]
    """By cycle and policy."""
    open: dict[str, OpenDrive]
    """By policy, real driving at the level of the brakes."""


class Drawn(NamedTuple):
    """A drawn car at the level of its brakes."""

    lots: float
    """Emission of a lining in front over one at the rear."""
    saved: dict[tuple[str, str, str], float]
    """Share of (particles, worn), by quantity, cycle and policy."""


def drive_shipped(number: int) -> Driven:
    """Drive one of `SHIPPED` over both cycles with and without the policy."""
    car = SHIPPED[number]
    models = emission_models(car.config, car.plant, CAR)
    drives = {
        (cycle, policy): drive_cycle(car, models, cycle, policy, CAR)
        for cycle in CYCLES
        for policy in POLICIES
    }
    trip, opened = real_driving_profile(), {}
    if car.config == car.plant:
        for policy in POLICIES:
            params = new_params(with_models(car.config, models, policy))
            opened[policy] = drive_open(drawn(car.plant, CAR), params, trip)
    return Driven(car, drives, opened)


def draw_car(number: int, name: str) -> Drawn:
    """Return the savings of the policies on a drawn car."""
    seed = FIRST_DRAW + number
    car, models = drawn(name, seed), emission_models(name, name, seed)
    saved: dict[tuple[str, str, str], float] = {}
    for cycle, trips in ((REAL_DRIVING, real_driving_profile()), (WLTP_BRAKE, wltp_brake_profile())):
        drives: dict[str, OpenDrive] = {}
        for policy in ("off", "dust", "wear"):
            config = with_models(name, models, policy)
            if policy == "wear":
                config = _measured(config, drives["off"])
            drives[policy] = drive_open(car, new_params(config), trips)
        for policy in ("dust", "wear"):
            for what in ("particles", "worn"):
                less = getattr(drives[policy], what).sum() / getattr(drives["off"], what).sum()
                saved[what, cycle, policy] = float(1.0 - less)
    return Drawn(float(car["emission_scale"][0, 0] / car["emission_scale"][0, 2]), saved)


def _measured(config: Config, driven: OpenDrive) -> Config:
    """Return a configuration whose rear linings have the scale that a measured thickness gives (section 7.6).

    `driven`: what was measured, beside the front's linings and by the work of each axle.
    """
    by_work = driven.worn / driven.work
    scale = float(by_work[2:].sum() / by_work[:2].sum())
    return with_keys(config, {"rear.pad.road_scale": scale})


def limit_rows(cars: list[Driven]) -> list[tuple[str, ...]]:
    """Return a row a car and cycle, as configured."""
    full = {d.car.plant: d for d in cars if d.car.config == d.car.plant}
    rows: list[tuple[str, ...]] = []
    for driven in cars:
        for cycle in CYCLES:
            drive, whole = driven.drives[cycle, "off"], full[driven.car.plant].drives[cycle, "off"]
            km = 1e-3 * drive.distance
            rows.append(
                (
                    driven.car.config,
                    cycle,
                    f"{drive.true_mass_per_km:.1f}",
                    f"{drive.mass_per_km:.1f}",
                    f"{LIMITS[driven.car.config]:.0f}",
                    f"{driven.car.coefficient * whole.true_mass_per_km:.1f}",
                    f"{1e-9 * drive.particles.sum() / km:.2f}",
                    _known(1e-9 * drive.particles_per_km),
                    f"{1e-6 * drive.work.sum() / km:.3f}",
                    f"{drive.work.sum() / whole.work.sum():.2f}",
                )
            )
    return rows


def saving_rows(cars: list[Driven]) -> list[tuple[str, ...]]:
    """Return a row a car, cycle and policy."""
    rows: list[tuple[str, ...]] = []
    for driven in cars:
        for cycle in CYCLES:
            before = driven.drives[cycle, "off"]
            for policy in POLICIES:
                drive = driven.drives[cycle, policy]
                particles = drive.particles.sum() / before.particles.sum()
                rows.append(
                    (
                        driven.car.config,
                        cycle,
                        policy,
                        _percent(1.0 - particles),
                        _percent(1.0 - drive.worn.sum() / before.worn.sum()),
                        f"{share_of_energy(drive.work):.2f}",
                        f"{drive.hottest[:2].max():.0f}, {drive.hottest[2:].max():.0f}",
                        f"{1e-6 * drive.work.sum():.2f}",
                        f"{1e-6 * drive.regenerated:.2f}",
                        f"{1e-6 * drive.charged:.2f}",
                        f"{100 * drive.greatest_slip[0]:.1f}, {100 * drive.greatest_slip[1]:.1f}",
                        f"{drive.rear_ahead:+.3f}",
                        f"{drive.guarded:.2f}",
                        f"{drive.speed_error:.3f}",
                        _verdict(driven, cycle, policy, 100.0 * (1.0 - particles)),
                    )
                )
    return rows


def _verdict(driven: Driven, cycle: str, policy: str, saved: float) -> str:
    judged = driven.car.coefficient == 1.0 and cycle == REAL_DRIVING and policy == "dust"
    return verdict(Goal("", saved, least=GOAL)) if judged else "–"


def _percent(share: float) -> str:
    return f"{100.0 * share:+.1f}"


def _known(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "not known"


def draw_rows(draws: dict[str, list[Drawn]]) -> list[tuple[str, ...]]:
    """Return a row a car, cycle and policy: median, least and greatest over the draws."""
    rows: list[tuple[str, ...]] = []
    for name, cars in draws.items():
        for cycle in CYCLES:
            for policy in ("dust", "wear"):
                found = [
                    100.0 * np.array([c.saved[w, cycle, policy] for c in cars]) for w in ("particles", "worn")
                ]
                rows.append(
                    (
                        name,
                        cycle,
                        policy,
                        *(f"{np.median(x):+.1f} ({x.min():+.1f} to {x.max():+.1f})" for x in found),
                        f"{min(c.lots for c in cars):.2f} to {max(c.lots for c in cars):.2f}",
                    )
                )
    return rows


def open_rows(cars: list[Driven]) -> list[tuple[str, ...]]:
    """Return the brake-level form beside the closed loop, a row a car and policy."""
    rows: list[tuple[str, ...]] = []
    for driven in cars:
        for policy, opened in driven.open.items():
            closed = driven.drives[REAL_DRIVING, policy]
            rows.append(
                (
                    driven.car.config,
                    policy,
                    *(
                        _percent(float(getattr(opened, what).sum() / getattr(closed, what).sum() - 1.0))
                        for what in ("work", "particles", "worn")
                    ),
                    *(f"{at.hottest[:2].max():.0f}, {at.hottest[2:].max():.0f}" for at in (opened, closed)),
                )
            )
    return rows


TEXT: Final = (
    "What `control.minimise` does: [control.md](../control.md#braking-against-dust); the cycles: "
    "[driving-cycle.md](../driving-cycle.md). The WLTP-Brake cycle here has the published totals, not the "
    "regulation's trace: **no figure below is an approval figure.** Cars are drawn (wide) from config/plant "
    "with bedded brakes; dust and wear are those of the plant's own laws (tools/brakelab/plant/emission.py, "
    "wear.py), which nothing on board knows. The ECU's emission models of both axles are identified from "
    "eight trips with a counter, as `identify dust` finds them; its law of wear is that of Table 7.1.\n\n"
    f"Limits: Regulation (EU) 2024/1257 (Euro 7) allows to cars {euro7.WORDS} mg/km of particles up to "
    "10 µm, for new types from 29 November 2026; there is none on their number. (The Commission's proposal "
    "had 3 for all from 2035. Read in summaries by S&P Global Mobility, 2026, and Freshfields, 2022; the "
    "text of the regulation was not at hand.) Electrified cars "
    "are tested with linings alone and multiply by the friction braking share coefficient c of UN GTR 24: "
    "1 for linings alone, 0.17 for battery electric cars, 0.34 for plug-in hybrids, about 0.5 to 0.6 for "
    "others. Of these only 1 and, in the proposal of 2022, 0.15 for battery electric cars were found in a "
    "source (S&P Global Mobility): **check c before use.**"
)


def _run(asked: Asked) -> Measured:
    cars = run_each("cycles", drive_shipped, range(len(SHIPPED)))
    names = [car.config for car in SHIPPED if car.config == car.plant]
    draws = {name: run_each("cycles", partial(draw_car, name=name), range(DRAWS)) for name in names}
    tables = [
        Table(
            "Beside the limits",
            ("car", "cycle", "mass [mg/km]", "by the ECU [mg/km]", "Euro 7 [mg/km]",
             "c × mass with linings alone [mg/km]", "particles [10⁹/km]", "by the ECU [10⁹/km]",
             "brakes [MJ/km]", "of that of linings alone"),
            limit_rows(cars),
            f"Drawn car {CAR} of each, `control.minimise` off. Mass: the airborne half of what the linings "
            "lose, true by the plant's law; without the discs, which Euro 7 counts. c: friction share "
            "coefficient, 1 or 0.17. Real driving: the trip of seed 1; the WLTP-Brake cycle trip by trip, "
            "each begun with the disc cooled. Last column: what c would be for these motors.",
        ),
        Table(
            "What braking against dust saves and costs",
            ("car", "cycle", "minimise", "particles saved [%]", "mass saved [%]", "front's share of the work",
             "hottest front, rear [degC]", "brakes [MJ]", "regenerated [MJ]", "into the battery [MJ]",
             "slip front, rear [%]",
             "rear ahead", "slip guard [s]", "speed error [m/s]", "goal"),
            saving_rows(cars),
            f"Closed loop, drawn car {CAR}. Goal: {GOAL:.0f} % of particles in real driving without "
            "motors. Rear ahead: grip used by the rear less that of the front, at most, by true forces "
            "at a braking rate of 0.15 to 0.8; above 0 with the policy off as well, where rear linings rub "
            "harder than is counted on. Slip while linings brake: 99.9 % of the time are below.",
        ),
        Table(
            "Over drawn cars",
            ("car", "cycle", "minimise", "particles saved [%]", "mass saved [%]", "lots front over rear"),
            draw_rows(draws),
            f"Cars {FIRST_DRAW} to {FIRST_DRAW + DRAWS - 1}, at the level of the brakes, temperatures known; "
            "median (least to greatest). Lots: emission of the front's linings over the rear's by batch. "
            "With wear, the rear's law has the scale that measured linings give (section 7.6).",
        ),
        Table(
            "The level of the brakes beside the closed loop",
            ("car", "minimise", "work [%]", "particles [%]", "mass [%]", "hottest open [degC]",
             "hottest closed [degC]"),
            open_rows(cars),
            "The real-driving trip; open over closed, minus 1.",
        ),
    ]  # fmt: skip
    return Measured(tables)


STUDY: Final = Study("Dust and wear over two cycles", TEXT, _run)
