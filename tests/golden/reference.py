"""Committed outputs (`outputs.csv`) and their comparison with those of a run.

A line is the run, a part of what it gives, hashes and six values. Bits are compared where processor and
libraries are those they were written with (`made_on.json`); words, and values within a tolerance, everywhere.
Parts are texts, and arrays of numbers or of texts: the values of a text are its numbers, its words the rest.
"""

import csv
import fcntl
import hashlib
import json
import os
import platform
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
REFERENCE, MADE_ON = HERE / "outputs.csv", HERE / "made_on.json"
UPDATE = os.environ.get("BRAKE_ECU_UPDATE_GOLDEN") == "1"
SAMPLES = 6
ROUNDED = 2e-2
"""Relative tolerance of texts: a number of two digits may be rounded otherwise on another machine."""
NUMBER = re.compile(r"[-+\N{MINUS SIGN}]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")

Part = str | np.ndarray


def machine() -> dict[str, str]:
    """Return what may round differently."""
    info = Path("/proc/cpuinfo").read_text().splitlines()
    flags = sorted(next((line for line in info if line.startswith("flags")), "").split())
    return {
        "processor": hashlib.sha256(" ".join(flags).encode()).hexdigest()[:12],
        "libc": "-".join(platform.libc_ver()),
        **{name: version(name) for name in ("numba", "numpy", "scipy", "scikit-learn", "bokeh")},
    }


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:12]


def _line(part: Part) -> list[str]:
    """Return the hash of an array, or of a text's words and of the text, and values of either."""
    if not isinstance(part, str) and part.dtype.kind in "OU":
        part = " ".join(part)
    if isinstance(part, str):
        numbers = [float(number.replace("\N{MINUS SIGN}", "-")) for number in NUMBER.findall(part)]
        values, words = np.array(numbers), f"{_hash(NUMBER.sub('#', part).encode())} "
        bits = _hash(part.encode())
    else:
        values, words = np.array(part, np.float64), ""
        values[np.isnan(values)] = np.nan  # one NaN, whatever its payload
        bits = _hash((values + 0.0).tobytes())
    places = np.linspace(0, max(len(values) - 1, 0), SAMPLES + 2).round().astype(int)[1:-1]
    return [words + bits, *(f"{values[place]:.9g}" if len(values) else "" for place in places)]


def _committed(run: str) -> dict[str, list[str]]:
    with REFERENCE.open(newline="") as file:
        return {row[1]: row[2:] for row in csv.reader(file) if row[0] == run}


def _write(run: str, found: Mapping[str, list[str]]) -> None:
    """Replace the lines of one run, beside other workers that replace theirs."""
    with REFERENCE.open("r+", newline="") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        rows = [row for row in csv.reader(file) if row[0] != run]
        rows += [[run, part, *cells] for part, cells in found.items()]
        file.seek(0)
        file.truncate()
        csv.writer(file, lineterminator="\n").writerows(sorted(rows, key=lambda row: row[0]))
    MADE_ON.write_text(json.dumps(machine(), indent=1) + "\n")


def _numbers(cells: list[str]) -> np.ndarray:
    return np.array([cell or "nan" for cell in cells], float)


def check(run: str, parts: Mapping[str, Part], relative: float) -> None:
    """Compare what a run gives with what is committed, or commit it; `relative`: tolerance of the values."""
    found = {name: _line(part) for name, part in parts.items()}
    if UPDATE:
        _write(run, found)
        return
    expected = _committed(run)
    assert list(found) == list(expected), "parts came or went"
    exact = machine() == json.loads(MADE_ON.read_text())
    wrong = []
    for name, (now_bits, *now) in found.items():
        was_bits, *was = expected[name]
        before = _numbers(was)
        scale = np.nanmax(np.abs(before), initial=1e-9)
        close = np.isclose(_numbers(now), before, relative, relative * scale, equal_nan=True)
        if not close.all():
            place = int(np.argmin(close))
            part = (place + 1) / (SAMPLES + 1)
            wrong.append(f"{name}: {now[place]}, was {was[place]} after {part:.0%} of it")
        elif now_bits.split()[:-1] != was_bits.split()[:-1]:
            wrong.append(f"{name}: other words")
        elif exact and now_bits != was_bits:
            wrong.append(f"{name}: other bits, the same {SAMPLES} values")
    assert not wrong, f"{len(wrong)} of {len(found)} parts of {run} changed:\n" + "\n".join(wrong)
