"""Pad state (`brake-ecu wear`): remaining thickness and distance; registration of new and measured pads."""

import math
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from ecu.algorithm.monitoring.wear import LEG, WEAR_STATE, restore_wear
from ecu.algorithm.monitoring.wear_belief import mass_by_law
from ecu.algorithm.step import new_state
from ecu.contract.records import N_LEGS, N_MEASURED, RecordArray
from ecu.contract.signals import CORNERS
from ecu.errors import UserError
from ecu.output import give
from ecu.recording.restored import restored
from ecu.recording.store import alone, open_store, save
from ecu.settings.config import Config, load_config, new_params, store_key
from ecu.settings.pad import Pad

GAUGE: Final = 0.1  # mm, standard deviation of a thickness measured on the car
TWO_SIDED: Final = 1.96  # standard deviations of a band of 95 %
LEAST_DISTANCE: Final = 50e3  # m with these pads, before a remaining distance is given
FEW_LEGS: Final = 0.3  # relative, of the wear per distance with fewer than three legs
PLACES: Final = {"front": (0, 1), "rear": (2, 3), "all": (0, 1, 2, 3)} | {
    corner: (i,) for i, corner in enumerate(CORNERS)
}
"""Corners of what is fitted with new pads."""


class Corner(NamedTuple):
    """One corner's pads; thickness and wear in mm, distances in km, NaN: not known yet."""

    corner: str
    thickness: float
    sigma: float
    wear: float
    mass: float
    """Wear of both pads, g."""
    scale: float
    """Wear by measured thicknesses over wear by the law."""
    driven: float
    remaining: float
    remaining_low: float
    remaining_high: float
    measurements: int
    told: bool
    """These pads were registered as new when counting began."""


def pads(config: Config) -> tuple[Pad, Pad, Pad, Pad]:
    """Return the pads of the four corners."""
    return config.front.pad, config.front.pad, config.rear.pad, config.rear.pad


def fit_new(wear: Any, place: str) -> None:
    """Register new pads in one of `PLACES`; `wear` is one `WEAR`."""
    for i in PLACES[place]:
        for name in ("regressors", "friction_error", "temperature_error", "measured_at", "leg_ends"):
            wear[name][..., i] = 0.0
        for name in ("measured_wear", "measured_sigma"):
            wear[name][:, i] = 0.0
        wear["measurements"][i], wear["told"][i], wear["fitted_at"][i] = 0, 1, wear["odometer"]


def add_measurement(wear: Any, i: int, lost: float, sigma: float) -> None:
    """Store a measurement of corner i at `lost` [mm] below new; drop the oldest of too many."""
    n = int(wear["measurements"][i])
    if n == N_MEASURED:
        for name in ("measured_wear", "measured_sigma", "measured_at"):
            wear[name][:-1, ..., i] = wear[name][1:, ..., i].copy()
        n -= 1
    wear["measured_wear"][n, i], wear["measured_sigma"][n, i] = lost, sigma
    wear["measured_at"][n, :, i] = wear["regressors"][:, i]
    wear["measurements"][i] = n + 1


def worn_off(wear: Any, pad: Pad, i: int, thickness: float) -> float:
    """Return the wear [mm] by a thickness [mm] measured at corner i.

    Raises:
        UserError: the pad would be thicker than new, than at the last measurement, or next to none.
    """
    name = f"{CORNERS[i]}={thickness:g}"
    n = int(wear["measurements"][i])
    last = pad.thickness_new - wear["measured_wear"][n - 1, i] if n else pad.thickness_new
    before = f"the {last:.2f} mm measured before" if n else f"the {last:g} mm of a new pad"
    if thickness > last + TWO_SIDED * math.sqrt(2.0) * GAUGE:
        axle = "front" if i < 2 else "rear"
        raise UserError(
            "--measured", name, f"thicker than {before}: measure again, or give --new-pads {axle} first"
        )
    if not thickness > GAUGE:  # as metres would be
        raise UserError("--measured", name, "give the thickness of the lining in mm, without the backplate")
    return pad.thickness_new - thickness


def measure(wear: Any, pad: Pad, i: int, thickness: float) -> None:
    """Store a thickness [mm] measured at corner i. Raises UserError, as `worn_off`."""
    add_measurement(wear, i, worn_off(wear, pad, i, thickness), GAUGE)


def rate_per_metre(params: Any, wear: Any, i: int) -> tuple[float, float]:
    """Return the law's mass per distance [g/m] at corner i and its relative standard deviation.

    From this car's own driving since the pads were fitted; the deviation is that of the mean over legs.
    """
    driven = float(wear["odometer"] - wear["fitted_at"][i])
    if driven < LEAST_DISTANCE:
        return math.nan, math.nan
    rate = mass_by_law(params, wear["regressors"], i) / driven
    legs = int(wear["legs"])
    whole = max(legs - N_LEGS, math.ceil(float(wear["fitted_at"][i]) / LEG) - 1, 0)
    order = [leg % N_LEGS for leg in range(whole, legs)]  # that of the fitting is a part: it only begins them
    masses = np.diff([mass_by_law(params, wear["leg_ends"][k], i) for k in order])
    masses = masses[masses > 0.0]
    if len(masses) < 3:
        return rate, FEW_LEGS
    return rate, float(np.std(masses, ddof=1) / np.mean(masses) / math.sqrt(len(masses)))


def appraise(params: RecordArray, learned: RecordArray, config: Config) -> list[Corner]:
    """Return the state of the pads by `learned` (`LEARNED`, shape (1,))."""
    p, wear = params[0], learned[0]["wear"]
    state = np.zeros(1, WEAR_STATE)[0]
    restore_wear(p, state, learned[0])
    corners = []
    for i, pad in enumerate(pads(config)):
        lost, sigma = float(state["wear"][i]), float(state["sigma"][i])
        rate, spread = rate_per_metre(p, wear, i)
        scale = float(state["belief"]["scale"][i])
        left = pad.thickness_new - pad.thickness_worn - lost
        per_km = 1e3 * rate * scale / float(p["pad_mass"][i])
        reach = left / per_km if per_km > 0.0 else math.nan
        by_rate = math.hypot(spread, math.sqrt(max(float(state["belief"]["scale_variance"][i]), 0.0)))
        half = TWO_SIDED * math.hypot(sigma / per_km, max(left, 0.0) / per_km * by_rate) if per_km else reach
        driven = 1e-3 * float(wear["odometer"] - wear["fitted_at"][i])
        corners.append(
            Corner(
                CORNERS[i],
                pad.thickness_new - lost,
                sigma,
                lost,
                float(state["mass"][i]),
                scale,
                driven,
                max(reach, 0.0),
                max(reach - half, 0.0),
                max(reach + half, 0.0),
                int(wear["measurements"][i]),
                bool(wear["told"][i]),
            )
        )
    return corners


def lines(corners: list[Corner]) -> list[str]:
    """Return the pads as a table, with a sentence on unknown values."""
    table = ["corner  lining [mm]  ± 95 %  worn off [g]  left [km]     95 % band [km]"]
    for c in corners:
        if math.isfinite(c.remaining):
            reach = f"{c.remaining:9.0f}  {c.remaining_low:9.0f}–{c.remaining_high:.0f}"
        else:
            reach = f"{'–':>9}  drive {1e-3 * LEAST_DISTANCE:.0f} km first"
        table.append(
            f"{c.corner:6}  {c.thickness:11.2f}  {TWO_SIDED * c.sigma:6.2f}  {c.mass:12.1f}  {reach}"
        )
    if unknown := [c.corner for c in corners if not c.told and not c.measurements]:
        names = ", ".join(unknown)
        table.append(
            f"{names}: taken as half worn, give or take half; --measured or --new-pads says what is there"
        )
    if measured := [f"{c.corner} {c.scale:.2f}" for c in corners if c.measurements]:
        table.append("wear over what the law gives, as measured: " + ", ".join(measured))
    return table


def parse_measured(text: str, where: str = "--measured") -> dict[int, float]:
    """Return thicknesses [mm] by corner from "fl=9.8,fr=9.7", given at `where`.

    Raises:
        UserError: it is not of that form.
    """
    found = {}
    for part in text.split(","):
        corner, _, value = part.strip().partition("=")
        try:
            thickness = float(value)
        except ValueError:
            thickness = math.nan
        if corner not in CORNERS or not math.isfinite(thickness):
            raise UserError(where, part.strip(), f"give corner=mm, corners {', '.join(CORNERS)}")
        found[CORNERS.index(corner)] = thickness
    return found


def wear_command(config: Path, state: Path, new_pads: str | None, measured: str | None) -> None:
    """Print the state of the pads, after registering new or measured ones.

    Raises:
        UserError: an argument is wrong, or a daemon holds the store.
    """
    vehicle = load_config(config)
    params = new_params(vehicle)
    if new_pads is not None and new_pads not in PLACES:
        raise UserError("--new-pads", new_pads, f"choose {', '.join(PLACES)}")
    if not state.is_dir():
        raise UserError("--state", str(state), "no such folder; give the one that `run` or `replay` keeps")
    thicknesses = parse_measured(measured) if measured else {}
    changes = bool(new_pads or thicknesses)
    with alone(state) if changes else nullcontext():
        found = restored(state, vehicle, params)
        learned = found[1] if found else new_state(params)["learned"].copy()
        if new_pads is not None:
            fit_new(learned[0]["wear"], new_pads)
        for i, thickness in thicknesses.items():
            measure(learned[0]["wear"], pads(vehicle)[i], i, thickness)
        if changes:
            with closing(open_store(state)) as store:
                save(store, store_key(vehicle), learned)
    corners = appraise(params, learned, vehicle)
    print("\n".join(lines(corners)))
    give(corners=corners)
