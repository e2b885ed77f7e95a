"""Description of a dynamometer's recording: meaning of its columns, brake and inertia on it.

name = "front axle"                # of the lining that is written
[columns]                          # name in the file, and its unit
time = ["Time", "s"]               # s also of dates and times of day; may begin anew with each stop
pressure = ["P_Line", "psi"]
torque = ["Torque", "N m"]
speed = ["Speed", "rpm"]           # rpm, 1/min, rad/s of the disc; km/h, m/s, mph of the car
temperature = ["T_disc", "°F"]
speed_end = ["v_End", "km/h"]      # optional: each row is the summary of a stop; then `time` is how long it
                                   # took, `pressure` and `torque` are its means, `speed` its begin
temperature_end = ["T_End", "°C"]  # likewise; `temperature` is that before it
section = "Step"                   # optional: number of the section of the programme, in every row
concentration = ["PN", "1/cm³"]    # of trips with a particle counter
flow = ["Q_tunnel", "m³/h"]        # likewise
[brake]                            # as in config/plant/linings.toml; where CONFIG is given, its own
[rig]                              # inertia, pads, push_out_pressure
[disc]                             # optional; without, heating is found from the stops
[uncertainty]                      # optional, see `Uncertainty`
[manifest]                         # optional: names of a manifest's columns, mass_before = "Masse vorher"
"""

import math
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationError, model_validator

from brakelab.identify.units import COUNTED, UNITS
from brakelab.plant.friction.law import NotNegative, Positive, RigBrake, Section
from brakelab.plant.linings import Lining
from ecu.settings.config import Axle, Config, new_params
from ecu.settings.toml_file import describe, read_toml

Column = tuple[str, str]
ENDS: Final = {"speed_end": UNITS["speed"], "temperature_end": UNITS["temperature"]}


class Names(Section):
    time: Column
    pressure: Column
    torque: Column
    speed: Column
    temperature: Column
    speed_end: Column | None = None
    temperature_end: Column | None = None
    section: Annotated[str, Field(min_length=1)] | None = None
    concentration: Column = ("particle_concentration", "1/cm^3")
    flow: Column = ("tunnel_flow", "m^3/s")

    @model_validator(mode="after")
    def _units(self) -> Self:
        for quantity, units in (UNITS | COUNTED | ENDS).items():
            column = getattr(self, quantity)
            unit = column[1] if column else ""
            if column and unit not in units:
                raise ValueError(f"unit {unit!r} of {quantity} unknown; one of {', '.join(units)}")
        if self.temperature_end and not self.speed_end:
            raise ValueError("temperature_end belongs to rows that are stops: give speed_end")
        return self


class Rig(Section):
    inertia: Positive | None = None  # kg m^2, of the flywheel; without, found from torque and slowing
    pads: Literal[1, 2] = 2  # whose torque the sensor shows
    push_out_pressure: NotNegative = 0.5  # bar, that does not press the pads


class DiscGiven(Section):
    diameter: Positive = 0.33  # m
    heating: Positive | None = None  # K/J
    cooling: NotNegative = 1.8e-3  # 1/s, Table C.1 at large
    cooling_by_speed: NotNegative = 9e-5  # 1/m, likewise


class Uncertainty(Section):
    """Standard uncertainties (GUM) of what is the same in a whole stop: of calibrations and tolerances.

    What a section's scatter shows already, noise above all, does not belong here.
    """

    torque: NotNegative = 0.0  # N m, of its zero
    torque_gain: NotNegative = 0.0  # share of the reading
    pressure: NotNegative = 0.0  # bar, of its zero
    pressure_gain: NotNegative = 0.0  # share of the reading
    push_out_pressure: NotNegative = 0.0  # bar
    piston_area: NotNegative = 0.0  # share
    effective_radius: NotNegative = 0.0  # share


class Columns(Section):
    """A file of columns."""

    name: Annotated[str, Field(min_length=1)] = "mine"
    columns: Names
    brake: RigBrake
    rig: Rig = Rig()
    disc: DiscGiven = DiscGiven()
    uncertainty: Uncertainty | None = None
    manifest: dict[str, str] = Field(default_factory=dict)

    @classmethod
    def own(cls, lining: Lining, inertia: float, uncertainty: Uncertainty | None = None) -> Self:
        """Return the description of our own recordings of `lining` on a flywheel of `inertia` [kg m^2]."""
        names = Names(
            time=("time_s", "s"),
            pressure=("pressure_bar", "bar"),
            torque=("torque_Nm", "N m"),
            speed=("speed_km_h", "km/h"),
            temperature=("disc_temperature_C", "°C"),
        )
        disc = DiscGiven(**lining.disc.model_dump())
        rig = Rig(inertia=inertia)
        return cls(columns=names, brake=lining.brake, rig=rig, disc=disc, uncertainty=uncertainty)

    @classmethod
    def contract(cls, names: tuple[str, str, str, str, str], speed: str, config: Config, axle: str) -> Self:
        """Return the description of a file of fixed names and units, of a brake of an axle of CONFIG.

        `names`: of time [s], calliper pressure [bar], torque of both pads [N m], speed [`speed`: "rad/s" of
        the disc or "m/s" of the car] and disc temperature [degC].
        """
        brake: Axle = getattr(config, axle)
        radius = float(new_params(config)[0]["wheel_radius"][0 if axle == "front" else 2])
        units = ("s", "bar", "N m", speed, "°C")
        pad = RigBrake(
            piston_area=brake.pistons * math.pi / 4.0 * brake.piston_diameter**2,
            pad_area=brake.pad.area,
            effective_radius=brake.effective_radius,
            tyre_radius=radius,
        )
        disc = DiscGiven(
            heating=brake.disc_heating,
            cooling=brake.disc_cooling,
            cooling_by_speed=brake.disc_cooling_by_speed,
        )
        rig = Rig(push_out_pressure=brake.push_out_pressure)
        given = Names.model_validate(dict(zip(UNITS, zip(names, units, strict=True), strict=True)))
        return cls(columns=given, brake=pad, rig=rig, disc=disc)


def load_columns(path: Path, known: Columns | None = None) -> Columns:
    """Return the file of columns `path`; brake, rig and disc that it leaves out are those `known`.

    Raises:
        UserError: one line.
    """
    given = read_toml(path)
    if known is not None:
        given = known.model_dump(include={"brake", "rig", "disc"}) | given
    try:
        return Columns.model_validate(given)
    except ValidationError as error:
        raise describe(error, str(path), Columns) from None


def columns_text(columns: Columns) -> str:
    """Return it as TOML."""
    lines = [f'name = "{columns.name}"', "", "[columns]"]
    for quantity in (*UNITS, *ENDS):
        if column := getattr(columns.columns, quantity):
            lines.append(f'{quantity} = ["{column[0]}", "{column[1]}"]')
    if columns.columns.section is not None:
        lines.append(f'section = "{columns.columns.section}"')
    for section in ("brake", "rig", "disc", *(["uncertainty"] if columns.uncertainty else [])):
        lines += ["", f"[{section}]"]
        values = getattr(columns, section).model_dump(
            exclude_none=True, exclude_defaults=section == "uncertainty"
        )
        lines += [f"{name} = {value!r}" for name, value in values.items()]
    return "\n".join([*lines, ""])
