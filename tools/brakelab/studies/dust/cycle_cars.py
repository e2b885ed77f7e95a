"""Shipped cars with emission models of both axles, identified from trips with a counter (`identify dust`).

The model of an axle comes from `TRIPS` trips of its right brake in the enclosure, as `bench dust` has them;
it knows nothing of the law that emits. The simulated brakes are bedded.
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np

from brakelab.identify.dust.features import extract
from brakelab.identify.dust.fit import judge
from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.emission import RUN_IN
from brakelab.plant.records import RecordArray
from brakelab.plant.wear import RUN_IN as WEAR_RUN_IN
from brakelab.simulation.campaigns.dust_trips import TRIPS, campaign
from brakelab.simulation.configured import configured, with_keys
from brakelab.studies.dust.study import as_recorded, section
from ecu.settings.config import Config, new_params
from ecu.settings.dust import Dust
from ecu.settings.resources import resource

MODEL: Final = "monotone law"
CORNERS: Final = {"front": 1, "rear": 3}


class Shipped(NamedTuple):
    """A configuration and the plant that it is for."""

    config: str
    plant: str
    coefficient: float
    """Friction braking share of its type in approval, see `studies.cycles`."""


SHIPPED: Final = (
    Shipped("suv", "suv", 1.0),
    Shipped("sedan", "sedan", 1.0),
    Shipped("lcv", "lcv", 1.0),
    Shipped("suv-blended", "suv", 0.17),
)


def bedded(car: RecordArray) -> None:
    """Let brakes and linings of a car have run in; its parameters are overwritten."""
    car["emission_row"][:, :, RUN_IN] = 0.0
    car["wear_row"][:, :, WEAR_RUN_IN] = 0.0


def drawn(plant: str, seed: int) -> RecordArray:
    """Return the drawn car of a seed as the closed loop drives it, bedded."""
    car = draw(
        load_plant(resource(f"config/plant/{plant}.toml")),
        seed,
        load_widths(resource("config/plant/draw.toml"), "wide"),
    )
    bedded(car)
    return car


@cache
def emission_models(name: str, plant: str, seed: int) -> tuple[Dust, Dust]:
    """Return the models of front and rear brakes of a drawn car, as a laboratory finds them."""
    config, car, found = configured(name), drawn(plant, seed), []
    radius = new_params(config)[0]["wheel_radius"]
    for axle, corner in CORNERS.items():
        push_out = getattr(config, axle).push_out_pressure
        trips = [
            extract(as_recorded(trip, f"trip {k}", False, push_out), float(radius[corner]))
            for k, trip in enumerate(campaign(100 * seed + corner, trips=TRIPS, car=car, corner=corner), 1)
        ]
        found.append(section(judge(MODEL, trips, [], seed), trips))
    return found[0], found[1]


def with_models(name: str, models: tuple[Dust, Dust], minimise: str = "off") -> Config:
    """Return a shipped configuration with emission models, and `control.minimise`."""
    front, rear = models
    keys = {"front.dust": front, "rear.dust": rear, "control.minimise": minimise}
    return with_keys(configured(name), keys)


def share_of_energy(work: np.ndarray) -> float:
    """Return the front axle's share of the brakes' work, shape (4,)."""
    return float(work[:2].sum() / work.sum())
