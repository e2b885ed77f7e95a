"""Units accepted in signal maps, and their conversion into the contract's."""

from typing import Final

from ecu.errors import UserError

# Contract unit: the units that convert into it, as (factor, offset).
CONVERSIONS: Final[dict[str, dict[str, tuple[float, float]]]] = {
    "rad/s": {"rad/s": (1.0, 0.0), "deg/s": (0.017453292519943295, 0.0), "rpm": (0.10471975511965977, 0.0)},
    "m/s": {"m/s": (1.0, 0.0), "km/h": (1 / 3.6, 0.0), "mph": (0.44704, 0.0), "kn": (1852 / 3600, 0.0)},
    "m/s^2": {"m/s^2": (1.0, 0.0), "g": (9.80665, 0.0)},
    "bar": {
        "bar": (1.0, 0.0),
        "Pa": (1e-5, 0.0),
        "mbar": (1e-3, 0.0),
        "kPa": (0.01, 0.0),
        "MPa": (10.0, 0.0),
        "psi": (0.0689475729, 0.0),
    },
    "rad": {"rad": (1.0, 0.0), "deg": (0.017453292519943295, 0.0)},
    "N": {"N": (1.0, 0.0), "kN": (1000.0, 0.0)},
    "N m": {"N m": (1.0, 0.0), "kN m": (1000.0, 0.0)},
    "degC": {"degC": (1.0, 0.0), "K": (1.0, -273.15), "degF": (5 / 9, -160 / 9)},
    "%": {"%": (1.0, 0.0), "-": (100.0, 0.0)},
    "-": {"-": (1.0, 0.0), "%": (0.01, 0.0)},
}
# Spellings in databases, small letters without blanks; the prefix `Unit_` is a habit of some makers
_SPELLINGS: Final = {
    "": "-", "1": "-", "sed": "-", "unitless": "-", "none": "-",
    "kph": "km/h", "kmh": "km/h", "kmph": "km/h", "km/hr": "km/h", "kilometerperhour": "km/h",
    "mi/h": "mph", "m/sec": "m/s", "mps": "m/s", "meterpersecon": "m/s", "knots": "kn", "kt": "kn",
    "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg", "grad/s": "deg/s", "degreofarc": "deg",
    "deg/sec": "deg/s", "degree/s": "deg/s", "degree/sec": "deg/s", "degrees/s": "deg/s",
    "degrees/sec": "deg/s", "°/s": "deg/s", "°/sec": "deg/s", "dps": "deg/s", "degreofarcpersecon": "deg/s",
    "rad/sec": "rad/s", "1/min": "rpm", "r/min": "rpm", "u/min": "rpm", "min-1": "rpm", "minutinver": "rpm",
    "nm": "N m", "n*m": "N m", "n.m": "N m", "n-m": "N m", "newtometer": "N m", "knm": "kN m",
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "m/s**2": "m/s^2", "m/sec2": "m/s^2",
    "m/sec^2": "m/s^2", "mps2": "m/s^2", "mss": "m/s^2", "meterperseconsquar": "m/s^2",
    "forceofgravi": "g", "millibar": "mbar", "hpa": "mbar",
    "°c": "degC", "c": "degC", "degrecelsi": "degC", "°f": "degF", "percent": "%", "pct": "%",
}  # fmt: skip
_OWN: Final = {name.lower().replace(" ", ""): name for known in CONVERSIONS.values() for name in known}


def spelled(unit: str) -> str:
    """Return a unit in this module's spelling, as it came where it is not known."""
    name = unit.strip()
    if any(name in known for known in CONVERSIONS.values()):
        return name
    plain = name.lower().replace(" ", "").removeprefix("unit_")
    return _SPELLINGS.get(plain, _OWN.get(plain, name))


def conversion(
    unit: str, target: str, rolling_radius: float | None, where: str, key: str
) -> tuple[float, float]:
    """Return factor and offset from `unit` to the contract's unit `target`.

    A speed is converted into a wheel speed by the rolling radius [m]. Raises UserError for other units.
    """
    name = spelled(unit)
    known = CONVERSIONS.get(target, {target: (1.0, 0.0)})
    if name in known:
        return known[name]
    if target == "rad/s" and name in CONVERSIONS["m/s"] and key.startswith("inputs.wheel_speed"):
        if rolling_radius is None:
            raise UserError(
                where, "rolling_radius", f"missing; {key} is in {name}, give the wheel's radius in m"
            )
        return CONVERSIONS["m/s"][name][0] / rolling_radius, 0.0
    speeds = [*CONVERSIONS["m/s"]] if key.startswith("inputs.wheel_speed") else []
    raise UserError(
        where, key, f'"{unit}" does not turn into {target}; known here: {", ".join([*known, *speeds])}'
    )
