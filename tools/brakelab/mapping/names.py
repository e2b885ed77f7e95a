"""Hints in the names and units of signals."""

import re
from functools import cache
from itertools import chain
from typing import Final

from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.signals import without_corner

_CORNERS: Final = {
    "fl": ["fl", "lf", "frontleft", "leftfront", "frtlft", "lftfrt", "frl", "vl", "vornelinks", "lhf", "flh"],
    "fr": [
        "fr",
        "rf",
        "frontright",
        "rightfront",
        "frtrght",
        "rghtfrt",
        "frr",
        "vr",
        "vornerechts",
        "rhf",
        "frh",
    ],
    "rl": ["rl", "lr", "rearleft", "leftrear", "rrlft", "lftrr", "rel", "hl", "hintenlinks", "lhr", "rlh"],
    "rr": ["rr", "rearright", "rightrear", "rrrght", "rghtrr", "rer", "hr", "hintenrechts", "rhr", "rrh"],
}
"""Spellings of a corner: English in either order, German (vorn/hinten, links/rechts)."""

WORDS: Final = {
    "wheel_speed": ("whl", "wheel", "wss", "spd", "speed", "rad", "radgeschw", "raddrehzahl"),
    "vehicle_speed": ("speed", "spd", "velocity", "vel", "gps", "geschw", "vehicle", "veh"),
    "accel_x": ("long", "lgt", "ax", "x", "longitudinal", "laengs", "längs", "accel"),
    "accel_y": ("lat", "ay", "y", "lateral", "quer", "accel"),
    "yaw_rate": ("yaw", "gier", "yawrate", "rate"),
    "steering_angle": ("steer", "steering", "sas", "stw", "lenk", "lrw", "pinion", "angle", "whl"),
    "calliper_pressure": (
        *("press", "pressure", "pres", "prs", "cyl", "brk", "brake", "mc", "druck", "bremsdruck"),
    ),
    "pedal_pressed": ("brake", "brk", "bped", "pedal", "pressed", "press", "appl", "drv", "brems"),
    "pedal_position": ("brake", "brk", "bped", "pedal", "pedl", "stroke", "trvl", "position"),
    "accelerator_position": (
        *("aped", "accelerator", "gas", "throttle", "accel", "pedal", "pedl"),
        *("fahrpedal", "gaspedal", "drossel"),
    ),
    "motor_torque": ("tq", "trq", "torque", "mot", "motor", "whl", "wheel", "prpl", "axle"),
    "abs_active": ("abs", "active", "act", "actv", "brk"),
    "esp_active": ("esp", "esc", "vdc", "vsc", "stab", "active", "act", "actv", "ctl"),
    "reverse": ("reverse", "rvs", "rueckwaerts", "rückwärts", "backwards"),
}
"""Words that speak for an input."""
_ASKED: Final = (
    *("demand", "dmnd", "request", "req", "rq", "cmd", "command", "desired", "target", "tgt", "setpoint"),
    *("soll", "ziel", "ref", "min", "max", "limit", "lim"),
)
"""Words of what somebody asks for, which is no measurement."""
AGAINST: Final = {
    "vehicle_speed": ("engine", "eng", "motor", "fan", "wind", "rate", "accuracy", "lat", "long", *_ASKED),
    "pedal_pressed": ("park", "epb", "accelerator", "gas", "throttle", "clutch", "fault", "hold", "lamp"),
    "accel_x": ("pedal", "gas", "throttle", "position", "pos", "percentage", *_ASKED),
    "accel_y": ("pedal", "gas", "throttle", "position", "pos", *_ASKED),
    "steering_angle": ("rate", "speed", "torque", "tq", "sign", "offset", "geschw", "moment", *_ASKED),
    "yaw_rate": ("offset", "accel", "steer", "sas", *_ASKED),
    "calliper_pressure": (
        *("oil", "tire", "tyre", "fuel", "booster", "bstr", "vacuum", "vac", "turbo", "rail", "ac"),
        *("gradient", "torque", "pedal", "position", "pos", "stroke", "travel", "trvl", "light", "switch"),
        *_ASKED,
    ),
    "accelerator_position": ("brake", "brk", "accel_x", "long", "lat", "inverted"),
    "pedal_position": ("accelerator", "gas", "throttle", "clutch", "aped", "pressure", "torque"),
    "reverse": ("light", "lamp", "camera", "cam", "warn", "fault", "fail", "inhibit", "torque", *_ASKED),
    "abs_active": ("fail", "fault", "warn", "lamp", "def", "pas", "off", "diag"),
    "esp_active": ("fail", "fault", "warn", "lamp", "def", "pas", "off", "diag"),
}
"""Words that speak against it."""
COUNTING: Final = {"counter", "count", "cnt", "cntr", "alive", "ctr", "no"}
CHECKING: Final = {"crc", "cs", "checksum", "chk", "chksum", "qf", "qbit"}
"""Words of what a frame says of itself."""


_AXLES: Final = {
    "front": ("front", "frt", "f", "vorn", "vorne", "vorderachse", "va", "v"),
    "rear": ("rear", "r", "hinten", "hinterachse", "ha", "h"),
}
COUNTS: Final = ("", "v", "mv", "volt", "%", "-", "raw", "count", "counts")
"""Units of a pressure that leave its scale open: a sensor's own voltage, a share of its range."""


_SPOKEN: Final = frozenset(
    word
    for word in (*chain(*WORDS.values()), *chain(*AGAINST.values()), "front", "rear", "left", "right")
    if word.isalpha() and len(word) > 2
)
_ENDS: Final = frozenset(
    ("x", "y", *(word for spelt in _CORNERS.values() for word in spelt if len(word) == 2))
)
"""Short words that stand only at the end of a run."""


def words(name: str) -> list[str]:
    """Return the words of a signal's name in lower case: `WhlFl_W_Meas` gives whl, fl, w, meas.

    A run of letters is cut where known words make it up: `WHEELSPEEDFL` gives wheel, speed, fl.
    """
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name.replace("_", " "))
    return [word for part in parts for word in _cut(part.lower()) or [part.lower()]]


@cache
def _cut(run: str) -> tuple[str, ...]:
    """Return the known words that make up a run, the first as long as it can be; empty: they do not."""
    if run in _SPOKEN or run in _ENDS:
        return (run,)
    for length in range(len(run) - 1, 2, -1):
        if run[:length] in _SPOKEN and (rest := _cut(run[length:])):
            return run[:length], *rest
    return ()


def corner_of(name: str) -> tuple[str, str]:
    """Return the corner that a name speaks of and the name without it; empty: of none."""
    parts = words(name)
    for length in (2, 1):
        for place in range(len(parts) - length + 1):
            joined = "".join(parts[place : place + length])
            for corner, spellings in _CORNERS.items():
                if joined in spellings:
                    return corner, "_".join(parts[:place] + parts[place + length :])
    return "", "_".join(parts)


def axle_of(name: str) -> tuple[str, str]:
    """Return the axle, front or rear, that a name speaks of and the name without it; empty: of none."""
    parts = words(name)
    for place, part in enumerate(parts):
        for axle, spellings in _AXLES.items():
            if part in spellings:
                return axle, "_".join(parts[:place] + parts[place + 1 :])
    return "", "_".join(parts)


def score(name: str, target: str) -> float:
    """Return how much a name speaks for an input: words found less words against it."""
    stem, parts = without_corner(target), words(name)
    said, against = (sum(_speaks(parts, word) for word in of.get(stem, ())) for of in (WORDS, AGAINST))
    return float(said - 3 * against)


def _speaks(parts: list[str], word: str) -> bool:
    return any(part == word or (len(word) > 3 and part.startswith(word)) for part in parts)


def tells_direction(name: str, target: str) -> bool:
    """Return whether a name says which of two accelerations it is; True of other inputs."""
    if not target.startswith("accel_"):
        return True
    return any(_speaks(words(name), word) for word in WORDS[target] if word != "accel")


def tells_pressure(message: str, signal: str) -> bool:
    """Return whether a signal's name, or its message's, speaks of a pressure."""
    stems = ("press", "pres", "prs", "druck", "cyl")
    return any(part.startswith(stems) or "druck" in part for part in (*words(message), *words(signal)))


def tells_brake(message: str, signal: str) -> bool:
    """Return whether a pressure by name, or its message by its own, is one of the brakes."""
    stems = ("brk", "brake", "brems", "cyl", "calliper", "caliper", "esp", "esc", "abs", "vsa", "ibst", "ehb")
    return any(part.startswith(stems) for part in (*words(message), *words(signal)))


def names_itself(name: str, target: str) -> bool:
    """Return whether the name of a flag holds the first word of the input's own, in one of its spellings."""
    own = ("abs",) if target == "abs_active" else WORDS[target][:5]
    return bool(set(own) & set(words(name))) or any(part.startswith(own) for part in words(name))


def counts(unit: str, target_unit: str) -> bool:
    """Return whether a unit leaves the scale open: none, or what a pressure's sensor counts in."""
    return unit.strip().lower() in COUNTS if target_unit == "bar" else not unit.strip()


def converts(unit: str, target_unit: str) -> bool:
    """Return whether a database's unit turns into the contract's."""
    return bool(unit.strip()) and spelled(unit) in CONVERSIONS[target_unit]
