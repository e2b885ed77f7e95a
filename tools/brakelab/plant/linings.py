"""Lining and disc: entries of `config/plant/linings.toml`, and the dynamometer that carries one."""

from typing import Final

from brakelab.plant.dynamometer import AMBIENT, RIG
from brakelab.plant.emission import EmissionLaw
from brakelab.plant.friction.law import NotNegative, Positive, RigBrake, Section
from brakelab.plant.friction.laws import AnyLaw, law_row
from brakelab.plant.records import RecordArray, new_record
from brakelab.plant.wear import WearLaw

VEHICLE_LAW: Final = "SIM"


class Disc(Section):
    """Numbers of `disc.py`."""

    diameter: Positive  # m
    heating: Positive  # K/J (xi)
    cooling: NotNegative  # 1/s (delta_0)
    cooling_by_speed: NotNegative  # 1/m (delta_1)


class Lining(Section):
    """Lining with the brake and the disc of its measurement, and its friction laws by name."""

    brake: RigBrake
    disc: Disc
    friction: dict[str, AnyLaw]
    wear: WearLaw = WearLaw()
    emission: EmissionLaw = EmissionLaw()


class Linings(Section):
    """A lining file."""

    lining: dict[str, Lining]


def rig_with(lining: Lining, law: str, mass: float | None = None) -> RecordArray:
    """Return the rig that carries `lining` under its friction law `law`, shape (1,), dtype `RIG`.

    `mass` [kg] that the flywheel stands for; without, that of the law.
    """
    record = new_record(RIG)
    rig = record[0]
    entry, brake = lining.friction[law], lining.brake
    number, row = law_row(entry, brake)
    rig["law"], rig["row"] = number, row
    rig["mass"] = entry.rig_mass if mass is None else mass
    rig["gain"] = brake.gain(float(rig["mass"]))
    for name in ("piston_area", "effective_radius", "tyre_radius"):
        rig[name] = getattr(brake, name)
    for name in ("heating", "cooling", "cooling_by_speed"):
        rig[name] = getattr(lining.disc, name)
    rig["ambient"] = AMBIENT
    return record
