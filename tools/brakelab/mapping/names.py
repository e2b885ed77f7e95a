"""Hints in the names and units of signals."""

import re
from typing import Final

from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.signals import without_corner

_CORNERS: Final = (
    ("fl", ("fl", "lf", "frontleft", "leftfront", "frtlft", "lftfrt", "vl", "lhf", "flh")),
    ("fr", ("fr", "rf", "frontright", "rightfront", "frtrght", "rghtfrt", "vr", "rhf", "frh")),
    ("rl", ("rl", "lr", "rearleft", "leftrear", "rrlft", "lftrr", "hl", "lhr", "rlh")),
    ("rr", ("rr", "rearright", "rightrear", "rrrght", "rghtrr", "hr", "rhr", "rrh")),
)
"""Spellings of a corner: English in either order, German (vorn/hinten, links/rechts)."""

WORDS: Final = {
    "wheel_speed": ("whl", "wheel", "wss", "spd", "speed", "rad"),
    "accel_x": ("long", "lgt", "ax", "longitudinal", "accel"),
    "accel_y": ("lat", "ay", "lateral", "quer", "accel"),
    "yaw_rate": ("yaw", "gier", "yawrate", "rate"),
    "steering_angle": ("steer", "steering", "sas", "stw", "lenk", "pinion", "angle", "whl"),
    "calliper_pressure": ("press", "pressure", "pres", "prs", "cyl", "brk", "brake", "mc", "druck"),
    "pedal_pressed": ("brake", "brk", "bped", "pedal", "pressed", "press", "appl", "drv"),
    "pedal_position": ("brake", "brk", "bped", "pedal", "pedl", "stroke", "trvl"),
    "accelerator_position": ("aped", "accelerator", "gas", "throttle", "accel", "pedal", "pedl"),
    "motor_torque": ("tq", "trq", "torque", "mot", "motor", "whl", "wheel", "prpl", "axle"),
    "abs_active": ("abs", "active", "act", "actv", "brk"),
    "esp_active": ("esp", "esc", "vdc", "vsc", "stab", "active", "act", "actv", "ctl"),
}
"""Words that speak for an input."""
AGAINST: Final = {
    "pedal_pressed": ("park", "epb", "accelerator", "gas", "throttle", "clutch", "fault", "hold", "lamp"),
    "steering_angle": ("rate", "speed", "torque", "tq", "sign", "offset"),
    "yaw_rate": ("offset", "accel", "steer", "sas"),
    "calliper_pressure": (
        *("oil", "tire", "tyre", "fuel", "booster", "vacuum", "turbo", "rail", "ac"),
        *("demand", "dmnd", "request", "req", "target", "setpoint", "soll"),
    ),
    "accelerator_position": ("brake", "brk", "accel_x", "long", "lat"),
    "pedal_position": ("accelerator", "gas", "throttle", "clutch", "aped"),
    "abs_active": ("fail", "fault", "warn", "lamp", "def", "pas", "off", "diag"),
    "esp_active": ("fail", "fault", "warn", "lamp", "def", "pas", "off", "diag"),
}
"""Words that speak against it."""


def words(name: str) -> list[str]:
    """Return the words of a signal's name in lower case: `WhlFl_W_Meas` gives whl, fl, w, meas."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name.replace("_", " "))
    return [part.lower() for part in parts]


def corner_of(name: str) -> tuple[str, str]:
    """Return the corner that a name speaks of and the name without it; empty: of none."""
    parts = words(name)
    for length in (1, 2):
        for place in range(len(parts) - length + 1):
            joined = "".join(parts[place : place + length])
            for corner, spellings in _CORNERS:
                if joined in spellings:
                    return corner, "_".join(parts[:place] + parts[place + length :])
    return "", "_".join(parts)


def score(name: str, target: str) -> float:
    """Return how much a name speaks for an input: words found less words against it."""
    parts = words(name)
    stem = without_corner(target)

    def speaks(word: str) -> bool:
        return any(part == word or (len(word) > 3 and part.startswith(word)) for part in parts)

    return float(sum(map(speaks, WORDS[stem])) - 3 * sum(map(speaks, AGAINST.get(stem, ()))))


def names_itself(name: str, target: str) -> bool:
    """Return whether the name of a flag holds the first word of the input's own, in one of its spellings."""
    own = ("abs",) if target == "abs_active" else WORDS[target][:5]
    return bool(set(own) & set(words(name))) or any(part.startswith(own) for part in words(name))


def converts(unit: str, target_unit: str) -> bool:
    """Return whether a database's unit turns into the contract's."""
    return bool(unit.strip()) and spelled(unit) in CONVERSIONS[target_unit]
