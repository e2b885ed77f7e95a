"""Units of measured quantities, as rigs name them."""

from typing import Final

UNITS: Final[dict[str, dict[str, float]]] = {
    "time": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "pressure": {"bar": 1e5, "kPa": 1e3, "MPa": 1e6, "Pa": 1.0, "psi": 6894.757},
    "torque": {
        **dict.fromkeys(("N m", "Nm", "N·m"), 1.0),
        **dict.fromkeys(("kN m", "kNm"), 1e3),
        **dict.fromkeys(("lbf ft", "ft-lb", "lb-ft", "ft·lbf"), 1.355818),
    },
    "speed": {
        "rad/s": 1.0,
        "rpm": 0.10471976,
        "1/min": 0.10471976,
        "U/min": 0.10471976,
        "m/s": -1.0,
        "km/h": -1.0 / 3.6,
        "mph": -0.44704,
    },
    "temperature": {"°C": 1.0, "C": 1.0, "degC": 1.0, "K": 1.0, "°F": 1.0 / 1.8, "F": 1.0 / 1.8},
}
"""To s, Pa, N m, rad/s and K of difference; below zero: of the car's speed, to m/s."""
COUNTED: Final[dict[str, dict[str, float]]] = {
    "concentration": {"1/cm^3": 1.0, "1/cm³": 1.0, "#/cm³": 1.0, "1/l": 1e-3, "1/m^3": 1e-6, "1/m³": 1e-6},
    "flow": {"m^3/s": 1.0, "m³/s": 1.0, "m^3/h": 1 / 3600, "m³/h": 1 / 3600, "l/s": 1e-3, "l/min": 1 / 6e4},
}
"""To 1/cm^3 and m^3/s."""
ZEROS: Final = {"K": 273.15, "°F": 32.0, "F": 32.0}
"""Reading at 0 degC."""
